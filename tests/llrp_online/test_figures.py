import cv2
import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from llrp_online import figures
from llrp_online.figures.layout import Layout
from llrp_online.figures.style import NEGATIVE, POSITIVE, QUANTITY
from llrp_online.metrics import Score
from replay.targets import Targets

LINE = Targets.line(0.0, 0.30, 0.01).poses
GRID = Targets.grid([-1.0, 2.0, 0.5], [-1.0, 1.0, 0.5]).poses
LISTED = Targets.listed([[0.2, 0.0, 0.0], [0.3, 0.2, 0.5], [0.1, -0.2, -1.0]]).poses
FIVE = ["left", "center_left", "center", "center_right", "right"]


def score_of(targets, sensors, auc, half_width=0.05):
    auc = np.broadcast_to(np.asarray(auc, np.float64), (len(targets), len(sensors))).copy()
    n = np.full(auc.shape, 20, np.int64)
    return Score(targets, tuple(sensors), auc, auc - half_width, auc + half_width, n, 3 * n, 0.8)


def example_of(targets, sensors, cameras=1, seed=0):
    rng = np.random.default_rng(seed)
    shape = (len(targets), len(sensors))
    picture = rng.integers(0, 256, (8, 10, 3 * cameras), np.uint8)
    return picture, rng.integers(-1, 2, shape).astype(np.int8), rng.random(shape, np.float32)


def drawn_examples(targets, sensors, count, cameras=1):
    found = [example_of(targets, sensors, cameras, seed) for seed in range(count)]
    pictures, labels, probabilities = (list(part) for part in zip(*found, strict=True))
    captions = [f"frame {number}, at $5_0$" for number in range(count)]
    return figures.examples(pictures, labels, probabilities, captions, targets, sensors), found


def image_of(axes):
    (image,) = axes.get_images()
    return image


def texts(figure):
    figure.draw_without_rendering()
    return [text.get_text() for text in figure.findobj(matplotlib.text.Text) if text.get_text()]


def lines_by_label(axes):
    return {line.get_label().split(" (")[0]: np.asarray(line.get_ydata(), float) for line in axes.lines}


def all_figures():
    known = np.arange(2 * len(LINE)).reshape(-1, 2)
    path = np.cumsum(np.random.default_rng(0).normal(size=(50, 3)), 0)
    yield drawn_examples(LINE, FIVE, 7)[0]
    yield drawn_examples(GRID, ["floor", "wall"], 3, cameras=3)[0]
    yield drawn_examples(LISTED, ["rear"], 1)[0]
    yield figures.learning_curve([1, 2, 5], [0.5, None, 0.8], [None, 0.6, 0.9], [3, 0, 9])
    for targets, sensors in ((LINE, FIVE), (GRID, ["floor", "wall"]), (LISTED, ["rear", "right"])):
        score = score_of(targets, sensors, 0.8)
        score.auc[0] = np.nan
        yield figures.auc_by_distance(score)
        yield figures.auc_map(score)
    yield figures.trajectory(path, path[::5, :2])
    yield figures.known_labels(known, LINE)
    yield figures.known_labels(np.ones((len(GRID), 2), int), GRID)
    yield figures.known_labels(np.ones((3, 2), int), LISTED)


def test_every_figure_can_be_drawn_and_leaves_global_state_alone():
    before = dict(matplotlib.rcParams)
    for figure in all_figures():
        assert isinstance(figure, Figure)
        data = np.frombuffer(figures.png(figure, 60), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert picture is not None
        assert picture.std() > 5
    assert dict(matplotlib.rcParams) == before


def test_the_same_figure_is_the_same_file():
    assert len({figures.png(figures.known_labels(np.ones((31, 2), int), LINE)) for _ in range(2)}) == 1


def test_examples_show_predictions_labels_and_pictures():
    figure, found = drawn_examples(LINE, FIVE, 7)
    axes = [one for one in figure.axes if one.get_images()]
    assert len(axes) == 3 * 7
    for number, (picture, labels, probabilities) in enumerate(found):
        prediction, label, camera = axes[3 * number : 3 * number + 3]
        np.testing.assert_array_equal(image_of(prediction).get_array(), probabilities)
        np.testing.assert_array_equal(np.ma.getmaskarray(image_of(label).get_array()), labels < 0)
        np.testing.assert_array_equal(image_of(label).get_array().compressed(), labels[labels >= 0])
        np.testing.assert_array_equal(image_of(camera).get_array(), picture)
        for heat_map in (prediction, label):
            low, high = heat_map.get_ylim()
            assert low < high  # far at the top
            assert [tick.get_text() for tick in heat_map.get_xticklabels()] == ["L", "CL", "C", "CR", "R"]
        assert label.patch.get_hatch()  # what is unknown can be told from both classes in grey
        assert prediction.get_title(loc="left") == f"frame {number}, at $5_0$"
    assert axes[0].get_ylabel() == "distance [cm]"
    assert [tick.get_text() for tick in axes[0].get_yticklabels()] == ["0", "5", "10", "15", "20", "25", "30"]
    assert "columns: L left, CL center left, C center, CR center right, R right" in texts(figure)


def test_labels_are_dark_where_the_sensor_fires():
    figure, found = drawn_examples(LINE, FIVE, 1)
    labels = found[0][1]
    colours = image_of(figure.axes[1]).to_rgba(np.ma.masked_less(labels, 0))
    assert {to_hex(colour) for colour in colours[labels == 1]} == {POSITIVE}
    assert {to_hex(colour) for colour in colours[labels == 0]} == {NEGATIVE}
    assert (colours[labels == -1, 3] == 0).all()


def test_a_grid_is_seen_from_above_with_the_robot_looking_up_and_its_left_on_the_left():
    probabilities = np.zeros((len(GRID), 1), np.float32)
    probabilities[np.argmax(np.isclose(GRID[:, 0], 2.0) & np.isclose(GRID[:, 1], 1.0))] = 1  # far ahead, to the left
    picture, labels, _ = example_of(GRID, ["floor"], cameras=3)
    figure = figures.examples([picture], [labels], [probabilities], ["a"], GRID, ["floor"])
    image = image_of(figure.axes[0])
    rows, columns = np.nonzero(np.asarray(image.get_array()))
    left, right, bottom, top = image.get_extent()
    x_m = bottom + (rows[0] + 0.5) / 7 * (top - bottom)
    y_m = left + (columns[0] + 0.5) / 5 * (right - left)
    place = figure.axes[0].transData.transform([(y_m, x_m), (0.0, 0.0)])
    assert (x_m, y_m) == pytest.approx((2.0, 1.0))
    assert place[0, 0] < place[1, 0]
    assert place[0, 1] > place[1, 1]
    assert figure.axes[0].get_ylabel() == "x, forward [m]"
    camera = image_of(figure.axes[2]).get_array()
    np.testing.assert_array_equal(camera, np.concatenate(np.split(picture, 3, -1), 1))


def test_a_grid_takes_one_map_a_sensor():
    figure, found = drawn_examples(GRID, ["floor", "wall"], 1)
    maps = [image_of(axes).get_array() for axes in figure.axes if axes.get_images()]
    np.testing.assert_array_equal(maps[1], found[0][2][:, 1].reshape(7, 5))
    assert {"floor", "wall"} <= set(texts(figure))


def test_no_example_is_an_error():
    with pytest.raises(ValueError, match="at least one"):
        figures.examples([], [], [], [], LINE, FIVE)


def test_learning_curve_plots_both_means_and_chance():
    figure = figures.learning_curve([1, 2, 5], [0.55, None, 0.8], [None, 0.6, 0.9], [3, 0, 9])
    (axes,) = figure.axes
    lines = lines_by_label(axes)
    np.testing.assert_array_equal(lines["0 to 25 cm"], [0.55, np.nan, 0.8])
    np.testing.assert_array_equal(lines["0 to 15 cm"], [np.nan, 0.6, 0.9])
    np.testing.assert_array_equal(lines["chance"], [0.5, 0.5])
    assert axes.lines[0].get_xdata().tolist() == [1, 2, 5]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("robot time [min]", "mean AUC on held-out frames")
    assert any("n = 0 to 9" in text for text in texts(figure))
    assert axes.get_ylim()[0] < 0.5
    assert axes.get_ylim()[1] >= 1


def test_a_curve_of_nothing_but_undefined_means_still_draws():
    for minute in (0, 1):
        figures.png(figures.learning_curve([minute], [None], [None], [0]), 40)


def test_auc_by_distance_averages_a_group_and_is_blank_where_undefined():
    score = score_of(LINE, FIVE, np.linspace(0.9, 0.7, 31)[:, None] + [[0.02, 0.0, 0.03, 0.06, -0.02]])
    score.auc[3, 2] = score.low[3, 2] = score.high[3, 2] = np.nan
    score.auc[30] = score.low[30] = score.high[30] = np.nan
    (axes,) = figures.auc_by_distance(score).axes
    lines = lines_by_label(axes)
    np.testing.assert_allclose(lines["lateral sensors"][:30], score.auc[:30][:, [0, 4]].mean(1))
    assert lines["centre sensors"][3] == pytest.approx(np.mean(score.auc[3, [1, 3]]))
    assert np.isnan(lines["centre sensors"][30])
    np.testing.assert_allclose(axes.lines[0].get_xdata(), np.arange(31))
    assert axes.get_xlabel() == "distance of the target ahead [cm]"
    assert axes.get_xlim()[1] > 30
    band = axes.collections[0].get_paths()[0].vertices
    at_zero = band[band[:, 0] == 0, 1]
    np.testing.assert_allclose([at_zero.min(), at_zero.max()], [score.low[0, 1:4].mean(), score.high[0, 1:4].mean()])
    assert band[:, 0].max() == pytest.approx(29)


def test_auc_by_distance_says_n_and_shows_what_is_below_chance():
    figure = figures.auc_by_distance(score_of(LINE, FIVE, 0.31))
    assert figure.axes[0].get_ylim()[0] < 0.26
    assert f"centre sensors (n+ {31 * 3 * 20:,}, n− {31 * 3 * 60:,})" in texts(figure)


def test_sensors_without_such_names_get_a_line_each_and_rings_on_a_grid():
    score = score_of(GRID, ["floor", "wall"], [[0.8, 0.6]])
    (axes,) = figures.auc_by_distance(score).axes
    lines = lines_by_label(axes)
    assert set(lines) == {"floor", "wall", "chance"}
    np.testing.assert_allclose(lines["wall"], 0.6)
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [0, 0.5, 1.0, 1.5, 2.0])
    assert axes.get_xlabel() == "distance of the target [m]"


def test_without_intervals_no_band_is_claimed():
    score = score_of(LINE, FIVE, 0.8, half_width=np.nan)
    assert not any("interval" in text for text in texts(figures.auc_by_distance(score)))
    assert any("95 % interval" in text for text in texts(figures.auc_by_distance(score_of(LINE, FIVE, 0.8))))


@pytest.mark.parametrize(("targets", "sensors"), [(LINE, FIVE), (GRID, ["floor"]), (LISTED, ["rear", "right"])])
def test_auc_map_writes_every_value_where_it_belongs_and_leaves_the_rest_blank(targets, sensors):
    auc = np.linspace(0.45, 0.99, len(targets) * len(sensors)).reshape(len(targets), len(sensors))
    auc[0, 0] = np.nan
    figure = figures.auc_map(score_of(targets, sensors, auc))
    axes = figure.axes[0]
    grid = Layout(targets, sensors).grid is not None
    per_metre = Layout(targets, sensors).per_metre
    written = {tuple(np.round(text.get_position(), 6)): text.get_text() for text in axes.texts}
    assert len(written) == auc.size - 1
    for target, sensor in np.argwhere(~np.isnan(auc)):
        x_m, y_m, _ = targets[target] * per_metre
        place = (y_m, x_m) if grid else (sensor, target)
        assert written[tuple(np.round(place, 6))] == f"{auc[target, sensor]:.2f}".lstrip("0")
    shown = np.ma.filled(image_of(axes).get_array(), np.nan).reshape(auc.shape)
    np.testing.assert_array_equal(shown, auc)
    assert any("n+" in text and "only one class" in text for text in texts(figure))


def test_values_can_be_read_on_their_cells():
    figure = figures.auc_map(score_of(LINE, FIVE, np.linspace(0.5, 1, 155).reshape(31, 5)))
    for text in figure.axes[0].texts:
        sensor, target = text.get_position()
        ground = np.array(QUANTITY(image_of(figure.axes[0]).norm(image_of(figure.axes[0]).get_array()[target, sensor])))
        ink = 0.0 if text.get_color() == "black" else 1.0
        assert abs(ground[:3] @ [0.299, 0.587, 0.114] - ink) > 0.4


def test_trajectory_shows_path_events_start_and_end_on_equal_axes():
    path = np.array([[0, 0, 0], [1, 0, 0], [np.nan] * 3, [1, 2, 0], [3, 2, 0]], float)
    fired = np.array([[0.5, 0.0], [1.0, 0.0]])
    figure = figures.trajectory(path, fired, np.array([60.0, 120, 130, 180, 360]))
    axes = figure.axes[0]
    (line,) = (one for one in axes.collections if isinstance(one, LineCollection))
    np.testing.assert_array_equal(line.get_segments(), [[[0, 0], [1, 0]], [[1, 2], [3, 2]]])
    np.testing.assert_allclose(line.get_array(), [0.0, 2.0])
    assert line.get_clim() == (0, 5)
    marks = {one.get_label(): np.column_stack(one.get_data()) for one in axes.lines}
    np.testing.assert_array_equal(marks["a sensor fired (n = 2)"], fired)
    np.testing.assert_array_equal(marks["start"], [[0, 0]])
    np.testing.assert_array_equal(marks["end"], [[3, 2]])
    assert axes.get_aspect() == 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    assert "time since the start [min]" in texts(figure)


@pytest.mark.parametrize("count", [1, 3])
def test_trajectory_without_times_or_events(count):
    figure = figures.trajectory(np.zeros((count, 3)), np.zeros((0, 2)))
    assert "share of the run [%]" in texts(figure)
    with pytest.raises(ValueError, match="finite"):
        figures.trajectory(np.full((2, 3), np.nan), np.zeros((0, 2)))


def test_known_labels_stack_to_the_total_and_the_share_is_blank_where_none_is_known():
    known = np.stack([np.arange(31) * 30, np.arange(31) * 10], 1)
    figure = figures.known_labels(known, LINE)
    left, right = figure.axes
    positives, negatives = (np.array([bar.get_height() for bar in bars]) for bars in left.containers)
    np.testing.assert_array_equal(positives, known[:, 1])
    np.testing.assert_array_equal(negatives, known[:, 0])
    np.testing.assert_array_equal([bar.get_y() for bar in left.containers[1]], positives)
    share = np.asarray(right.lines[0].get_ydata(), float)
    assert np.isnan(share[0])
    np.testing.assert_allclose(share[1:], 25.0)
    assert f"n = {known.sum():,} known labels, {known[:, 1].sum():,} of them positive" in texts(figure)
    assert "[cm]" in left.get_xlabel()
    assert "[%]" in right.get_ylabel()


def test_known_labels_of_a_grid_are_maps_with_a_logarithmic_scale():
    known = np.zeros((len(GRID), 2), np.int64)
    known[4] = [90, 10]
    left, right = figures.known_labels(known, GRID).axes[:2]
    total = image_of(left).get_array().ravel()
    assert (total.compressed().tolist(), total[4]) == ([100], 100)
    assert isinstance(image_of(left).norm, matplotlib.colors.LogNorm)
    assert image_of(right).get_array().ravel().compressed().tolist() == [10.0]
