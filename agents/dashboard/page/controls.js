// Stop and release; pause, resume, save, roll back.

import { $, make, post, say } from "./dom.js";

export class Controls {
  constructor() {
    this.stopped = false;
    this.paused = false;
    this.failed = "";
    $("stop").addEventListener("click", () => this.press(true));
    $("release").addEventListener("click", () => this.press(false));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !document.querySelector("dialog[open]")) this.press(true);
    });
    $("pause").addEventListener("click", () => this.ask(this.paused ? "resume" : "pause", {}, () => (this.paused ? "Learning goes on." : "Learning is paused.")));
    $("save").addEventListener("click", () => this.ask("save", {}, (path) => `Saved to ${path}`));
    $("roll-back").addEventListener("click", () => {
      const version = Number($("version").value);
      this.ask("roll_back", { version }, (number) => `Back to version ${version}, published anew as version ${number}.`);
    });
  }

  hello() {
    this.versions = "";
  }

  async press(stop) {
    try {
      await post("/stop", { stop });
      this.failed = "";
    } catch (error) {
      this.failed = stop ? `STOP WAS NOT SENT (${error.message}). Use the robot's own switch.` : `Not released: ${error.message}`;
    }
    this.tell();
  }

  async ask(command, more, done) {
    const said = $("command-said");
    say(said, "…");
    said.className = "";
    try {
      say(said, done((await post("/learner", { command, ...more })).result));
    } catch (error) {
      said.className = "failed";
      say(said, `Not done: ${error.message}`);
    }
  }

  update(told) {
    this.obeyed = told.obeyed;
    this.stopped = told.stopped || Object.values(told.obeyed).some(Boolean);
    this.tell();
    if (!("learner_status" in told)) return;
    const learner = told.learner_status;
    this.paused = learner?.paused ?? false;
    say($("pause"), this.paused ? "Resume learning" : "Pause learning");
    const kept = (learner?.kept ?? []).slice().reverse();
    if (kept.join() !== this.versions && document.activeElement !== $("version")) {
      this.versions = kept.join();
      $("version").replaceChildren(...kept.map((number) => make("option", { value: number }, `${number}`)));
    }
    for (const id of ["pause", "save"]) $(id).disabled = !learner;
    $("roll-back").disabled = $("version").disabled = !kept.length;
  }

  tell() {
    const stop = $("stop"), who = Object.entries(this.obeyed ?? {});
    stop.setAttribute("aria-pressed", `${this.stopped}`);
    say(stop, this.stopped ? "Stopped" : "Stop");
    $("release").hidden = !this.stopped;
    const deaf = who.filter(([, obeys]) => !obeys).map(([name]) => name);
    let text = "";
    if (this.stopped && !who.length) text = "Told to stop. Nobody here says whether it does: look at the robot.";
    else if (this.stopped && deaf.length) text = `Told to stop; ${deaf.join(" and ")} has not said so yet.`;
    else if (this.stopped) text = `${who.map(([name]) => name).join(" and ")} stand still until released.`;
    $("stop-said").className = this.failed ? "failed" : "";
    say($("stop-said"), this.failed || text);
  }
}
