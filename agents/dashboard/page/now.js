// What the robot sees, and beside it what it expects its sensors to feel.

import { $, bytes, describe, make, onTheme, say } from "./dom.js";
import { draw, inWords, predicted } from "./cells.js";

export class Now {
  constructor() {
    this.urls = [];
    this.prediction = null;
    this.spoken = 0;
    onTheme(() => this.paint());
    new ResizeObserver(() => this.paint()).observe($("prediction"));
    $("prediction-legend").append(
      make("span", {}, "0 %", make("i", { className: "ramp" }), "100 % sure to feel something"),
    );
  }

  hello(hello, plan) {
    this.plan = plan;
    this.prediction = null;
    $("cameras").replaceChildren();
    this.paint();
  }

  update(told, pictures) {
    if (pictures.length) this.show(pictures, told);
    const [age] = told.ages.prediction ?? [null];
    const stale = age === null || age > 1;
    if (stale) say($("prediction-said"), age === null ? "No prediction yet." : `The last prediction is ${age.toFixed(0)} s old.`);
  }

  show(pictures, told) {
    const box = $("cameras");
    while (box.children.length < pictures.length) box.append(make("img", { alt: "What the camera sees now" }));
    pictures.forEach((picture, i) => {
      const url = URL.createObjectURL(picture);
      URL.revokeObjectURL(this.urls[i]);
      this.urls[i] = box.children[i].src = url;
    });
    say($("camera-said"), `Robot time ${told.shots_s.toFixed(1)} s.`);
    this.prediction = told.prediction ? bytes(told.prediction) : null;
    say($("prediction-said"), this.prediction ? "Expected of this very picture." : "No prediction of this picture.");
    this.paint();
  }

  paint() {
    if (!this.plan) return;
    draw($("prediction"), this.plan, this.prediction, predicted, true);
    if (Date.now() - this.spoken < 2000) return;
    this.spoken = Date.now(); // a screen reader that reads on is not to be interrupted ten times a second
    describe($("prediction"), this.prediction ? inWords(this.plan, this.prediction) : "No prediction.");
  }
}
