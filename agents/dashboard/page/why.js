// Why it is not learning, in words; and the numbers that the learner tells of itself.

import { $, make, number, say } from "./dom.js";

export class Why {
  constructor() {
    this.shown = "";
  }

  hello() {
    this.shown = "";
  }

  update(told) {
    if (!told.findings) return;
    const text = JSON.stringify(told.findings);
    if (text !== this.shown) {
      this.shown = text;
      $("findings").replaceChildren(...told.findings.map((finding) => {
        const item = make("li", { className: finding.grade }, make("strong", {}, title(finding)), make("span", {}, finding.what));
        if (finding.do) item.append(make("div", { className: "do" }, finding.do));
        item.dataset.cause = finding.cause;
        return item;
      }));
      const fine = told.findings.every((finding) => finding.grade === "fine" || finding.grade === "note");
      say($("why-title"), fine ? "Is it learning?" : "Why is it not learning?");
    }
    this.numbers(told);
  }

  numbers({ learner_status: learner, perceiver_status: perceiver, robot_status: robot, controller_status: controller }) {
    const rows = [];
    if (learner) {
      const known = sum(learner.known), positives = sum(learner.positives);
      rows.push(["robot time", `${(learner.robot_s / 60).toFixed(1)} min`], ["frames", `${learner.frames}`], ["with a label", `${learner.labelled}`], ["wait for labels", `${learner.waiting}`]);
      rows.push(["known labels", `${known}`], ["felt something", known ? `${((100 * positives) / known).toFixed(1)} %` : "–"], ["in memory", `${learner.remembered}`]);
      rows.push(["steps", learner.let_go >= 1 ? `${learner.steps}, ${learner.let_go.toFixed(0)} let go` : `${learner.steps}`], ["loss", number(learner.loss, 3)]);
      rows.push(["weights", learner.version === null ? "none" : `version ${learner.version}`], ["rejected", `${learner.rejected}`], ["drift events", `${learner.drift_events}`]);
    }
    if (perceiver) rows.push(["frame to prediction", `${number(perceiver.p50_ms, 1)} ms, p99 ${number(perceiver.p99_ms, 1)}`]);
    if (controller) rows.push(["behaviour", controller.behaviour]);
    const metres = robot && `${robot.metres.toFixed(1)} m`;
    if (robot) rows.push("link" in robot ? ["rolled", metres] : ["collisions", `${robot.collisions} in ${metres}`]);
    if (robot && "link" in robot) rows.push(["line", robot.link], ["its camera", robot.camera]);
    const list = $("numbers");
    if (list.children.length !== rows.length) list.replaceChildren(...rows.map(() => make("div", {}, make("dt"), make("dd"))));
    rows.forEach(([name, value], i) => (say(list.children[i].children[0], name), say(list.children[i].children[1], value)));
  }
}

const sum = (values) => values.reduce((total, value) => total + value, 0);
const title = ({ cause }) => cause[0].toUpperCase() + cause.slice(1);
