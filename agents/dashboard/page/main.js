// The page: one link, and the parts that each take what is theirs of what it brings.

import { $, make, number, say, words } from "./dom.js";
import { Plan } from "./cells.js";
import { Controls } from "./controls.js";
import { Curves } from "./curves.js";
import { Explain } from "./explain.js";
import { Film } from "./film.js";
import { Ground } from "./ground.js";
import { Link } from "./link.js";
import { Memory } from "./memory.js";
import { Now } from "./now.js";
import { Why } from "./why.js";

const SILENT_S = 1.5;

const controls = new Controls();
const curves = new Curves();
// Controls first: their Escape stops the robot unless the explanation is open, whose Escape then closes it.
const explain = new Explain();
const parts = [controls, new Now(), new Why(), new Film((key) => explain.open(key)), new Ground(), curves, new Memory(), explain];
let about = null;

function hello(told) {
  about = told;
  document.title = `${told.robot}: llrp dashboard`;
  say($("robot"), told.robot);
  const plan = new Plan(told);
  curves.labels = told.targets.length * told.sensors.length;
  parts.forEach((part) => part.hello?.(told, plan));
}

function update(told, pictures) {
  parts.forEach((part) => part.update?.(told, pictures));
  silence(told.ages);
  if (told.agents) agents(told.agents);
  if (told.agents) topics(told.ages);
}

/** A robot that says nothing must not look like one that stands still. */
function silence(ages) {
  const [odometry] = Object.entries(ages)[0][1];
  const camera = Math.max(...Object.entries(ages).slice(-1 - about.cameras, -1).map(([, [age]]) => age ?? Infinity));
  const robotSilent = odometry === null || odometry > SILENT_S;
  $("ground").classList.toggle("old", robotSilent);
  $("now").classList.toggle("old", camera > SILENT_S);
  const banner = $("banner");
  banner.classList.add("warn");
  banner.hidden = !robotSilent && camera <= SILENT_S;
  if (robotSilent) say(banner, odometry === null ? "The robot has not said anything yet." : `The robot has been silent for ${odometry.toFixed(0)} s. What you see of it is old.`);
  else if (!banner.hidden) say(banner, camera === Infinity ? "No picture has come yet." : `No picture for ${camera.toFixed(0)} s. The one you see is old.`);
}

function agents(there) {
  const text = JSON.stringify(there);
  if ($("agents").dataset.shown === text) return;
  $("agents").dataset.shown = text;
  $("agents").replaceChildren(...Object.entries(there).sort().map(([name, up]) => make("li", { className: up ? "" : "gone" }, up ? words(name) : `${words(name)} gone`)));
}

function topics(ages) {
  $("topics").replaceChildren(...Object.entries(ages).map(([name, [age, rate]]) =>
    make("li", { className: age === null || age > SILENT_S ? "old" : "" }, `${name}: ${age === null ? "never came" : age > SILENT_S ? `silent for ${age.toFixed(0)} s` : `${number(rate, 1)} a second`}`)));
}

function state(now, heard) {
  document.body.dataset.link = now;
  const banner = $("banner");
  say($("link"), { live: "live", stale: "stale", lost: "not connected", waiting: "connecting" }[now]);
  if (now === "live") return;
  banner.classList.remove("warn");
  banner.hidden = false;
  const seconds = ((Date.now() - heard) / 1000).toFixed(0);
  say(banner, now === "lost" ? `Not connected for ${seconds} s: what you see is old, and Stop may not reach the robot. Trying again.` : `The dashboard has been silent for ${seconds} s: what you see is old.`);
}

const link = new Link({ hello, update, state });
window.dashboard = { link }; // for those who measure how many updates a second arrive
