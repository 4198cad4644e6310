"""The command line as people meet it: help, exit codes, completion by three shells, progress bars."""

import contextlib
import io
import os
import pty
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console
from rich.progress import Progress

from agents import cli, progress
from agents.cli import COMMANDS, EXIT_CODES, main
from agents.commands import completion, experiment, options

ROOT = Path(__file__).parents[2]
LLRP = [sys.executable, "-m", "agents.cli"]
CONFIG = "configs/thymio.toml"


def run(*words, **more) -> subprocess.CompletedProcess:
    return subprocess.run([*LLRP, *map(str, words)], capture_output=True, text=True, check=False, cwd=ROOT, **more)


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("cli") / "drive.mcap"
    assert main(["record", "--simulate", "--minutes", "0.2", "--output", str(path)]) == 0
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples_that_parse_and_the_exit_codes(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    out = capsys.readouterr().out
    assert ended.value.code == 0
    examples = re.findall(rf"^  (llrp {command}\b.*)$", out, re.MULTILINE)
    assert examples
    for line in examples:
        words = shlex.split(re.split(r"\s{2,}|\s>\s", line)[0])
        assert cli._parser(command).parse_args(words[1:]).command == command
    for code, meaning in EXIT_CODES.items():
        assert f"  {code:<4d} {meaning}" in out
    assert max(map(len, out.splitlines())) <= 120


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert re.fullmatch(r"llrp-online \d+\.\d+\.\d+\S*\n", capsys.readouterr().out)


DONE, NO, USAGE, INTERRUPTED = EXIT_CODES


def test_zero_is_done(drive):
    assert main(["check", str(drive), "--config", CONFIG]) == DONE


def test_one_is_a_no_with_its_reason(tmp_path, drive, capsys):
    upside_down = tmp_path / "rig.toml"
    text = Path(CONFIG).read_text().replace("width = 80", "width = 64").replace("height = 64", "height = 80")
    upside_down.write_text(text)
    assert main(["check", str(drive), "--config", str(upside_down)]) == NO
    assert "swapped" in capsys.readouterr().out
    assert main(["label", "none.mcap", "--config", CONFIG, "--output", str(tmp_path / "l.npz")]) == NO
    assert capsys.readouterr().err == "llrp label: none.mcap: cannot be read: No such file or directory\n"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("check --config configs/thymio.toml", "expected either recordings or --live"),
        ("record --simulate --output x.mcap", "--simulate needs an end: give --minutes"),
        ("learn --config C --output R --held-out A", "--held-out goes with --recordings"),
        ("learn --config C --output R --recordings A --resume B --warm-start B", "give one of them"),
        ("learn --config C --output R --without-memory", "goes with --warm-start"),
        ("robot --speed 0", "argument --speed: expected a number above 0, got '0'"),
        ("robot --speed quick", "argument --speed: expected a number, got 'quick'"),
        ("robot --minutes nan", "argument --minutes: expected a number above 0, got 'nan'"),
        ("robot --seed -1", "argument --seed: expected a whole number of at least 0, got '-1'"),
        ("foxglove --port 70000", "argument --port: expected a whole number from 0 to 65535, got '70000'"),
        ("train A --config C --output R --steps 1.5", "argument --steps: expected a whole number, got '1.5'"),
        ("experiment scratch --processes 0", "expected a whole number of at least 1"),
        ("completion tcsh", "invalid choice"),
        ("lern", "invalid choice"),
    ],
)
def test_two_is_wrong_usage(words, reason, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    try:
        code = main(words.split())
    except SystemExit as ended:
        code = ended.code
    assert code == USAGE
    assert reason in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["configs"]


def test_130_is_ctrl_c_before_it_was_done(tmp_path):
    path = tmp_path / "long.mcap"
    words = ["record", "--simulate", "--minutes", "600", "--output", str(path)]
    started = subprocess.Popen([*LLRP, *words], cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    end_s = time.monotonic() + 60
    while not (path.exists() and path.stat().st_size > 100_000) and time.monotonic() < end_s:
        time.sleep(0.05)
    started.send_signal(signal.SIGINT)
    out, err = started.communicate(timeout=60)
    assert (started.returncode, out) == (INTERRUPTED, "")
    assert "Traceback" not in err


def test_a_reader_that_goes_away_gets_no_traceback():
    done = subprocess.run(
        f"{shlex.join(LLRP)} completion bash | true; exit ${{PIPESTATUS[0]}}",
        shell=True,
        executable=shutil.which("bash"),
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert (done.returncode, done.stderr) == (NO, "")


# --- completion


@pytest.fixture(scope="module")
def scripts(tmp_path_factory) -> dict[str, Path]:
    """What `llrp completion` prints for each shell, as a file."""
    folder, found = tmp_path_factory.mktemp("completion"), {}
    for shell in completion.SHELLS:
        found[shell] = folder / f"_llrp.{shell}"
        with found[shell].open("w") as file, contextlib.redirect_stdout(file):
            assert main(["completion", shell]) == DONE
    return found


def needs(shell: str):
    return pytest.mark.skipif(shutil.which(shell) is None, reason=f"no {shell} to try it in: apt-get install {shell}")


#: What is typed -> what must be offered.
TYPED = {
    "llrp experi": "experiment",
    "llrp label --outp": "--output",
    "llrp control --behaviour se": "seek",
    "llrp experiment cross": "crossval",
    "llrp label --config configs/thy": "configs/thymio.toml",
}


@needs("bash")
@pytest.mark.parametrize(("typed", "offered"), TYPED.items())
def test_bash_completes(scripts, typed, offered):
    words = shlex.split(typed)
    program = (
        f"source {scripts['bash']}; COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; "
        '_shtab_llrp; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == [offered]


@needs("fish")
def test_fish_completes(scripts):
    for typed, offered in TYPED.items():
        program = f"source {scripts['fish']}; complete -C '{typed}'"
        done = subprocess.run(["fish", "-N", "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
        assert [line.split("\t")[0] for line in done.stdout.splitlines()] == [offered]


@needs("zsh")
def test_zsh_completes(scripts, tmp_path):
    """By a shell in a terminal: zsh completes nowhere else."""
    (tmp_path / "_llrp").write_text(scripts["zsh"].read_text())
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(ROOT)
        os.execvpe("zsh", ["zsh", "-f", "-i"], {**os.environ, "TERM": "dumb", "HOME": str(tmp_path)})
    try:
        ask(
            terminal,
            f"fpath=({tmp_path} $fpath); autoload -Uz compinit; compinit -u -D; PS1='> '; echo re''ady\n",
            "ready",
        )
        for typed, offered in TYPED.items():
            ask(terminal, typed + "\t", f"{typed.rpartition(' ')[0]} {offered}")
            os.write(terminal, b"\x15")  # the line is taken back
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(terminal)


def ask(terminal: int, typed: str, expected: str) -> None:
    os.write(terminal, typed.encode())
    seen, end_s = "", time.monotonic() + 30
    os.set_blocking(terminal, False)
    while expected not in seen:
        assert time.monotonic() < end_s, seen
        try:
            seen += os.read(terminal, 65536).decode(errors="replace")
        except BlockingIOError:
            time.sleep(0.02)


# --- progress


def test_long_work_shows_how_far_it_is(drive, tmp_path, monkeypatch, capsys):
    checkpoint = tmp_path / "checkpoint"
    config = ("--config", CONFIG)
    shows = {
        ("record", "--simulate", "--minutes", 0.05, "--output", tmp_path / "d.mcap", *config): ["driving"],
        ("check", drive, *config): ["checking"],
        ("label", drive, *config, "--output", tmp_path / "l.npz"): ["labelling"],
        ("train", drive, *config, "--output", checkpoint, "--steps", 3): ["labelling", "training"],
        ("evaluate", checkpoint, drive, *config, "--rounds", 1): ["labelling", "predicting"],
        ("export", checkpoint, "--onnx", tmp_path / "e.onnx"): ["checking"],
        ("window", drive, *config, "--output", tmp_path / "w.html"): [
            "reading",
            "labelling by each window",
            "revisits",
        ],
        ("learn", "--recordings", drive, *config, "--output", tmp_path / "r"): ["learning"],
    }
    for words, bars in shows.items():
        terminal = Console(file=io.StringIO(), force_terminal=True, width=120)
        monkeypatch.setattr(progress, "ERRORS", terminal)
        assert main([str(word) for word in words]) == DONE, capsys.readouterr().err
        for name in bars:
            assert f"{name} " in terminal.file.getvalue(), words


def test_a_bar_of_recordings_knows_the_share_of_the_one_that_is_read(monkeypatch):
    shown = []

    class Bar(Progress):
        def update(self, task_id, *, completed=None, **more):
            shown.append(completed)
            super().update(task_id, completed=completed, **more)

    monkeypatch.setattr(progress, "Progress", Bar)
    for _, told in progress.track_recordings([Path("a"), Path("b")], "reading"):
        for share in (0.25, 0.251, 0.5, 0.4):
            told(share)
    assert shown == [0.25, 0.5, 1, 1.25, 1.5, 2]


def test_nobody_is_shown_a_bar_who_is_no_terminal(drive):
    done = run("check", drive, "--config", CONFIG)
    assert (done.returncode, done.stderr) == (DONE, "")


def test_what_a_study_may_be_is_offered_in_full():
    parser = cli.whole_parser()
    [commands] = [action for action in parser._actions if action.choices and action.dest == "command"]
    assert set(commands.choices) == set(COMMANDS)
    [study] = [action for action in commands.choices["experiment"]._actions if action.dest == "study"]
    assert set(study.choices) == set(experiment.STUDIES)
    assert options.speed("max") == float("inf")
