// The page: robots that a worker moves, drawn, plotted and controlled.

import { Chooser, Commands, element, Sliders } from "./controls.js";
import { Game } from "./game.js";
import { format, parse } from "./link.js";
import { Physics } from "./physics.js";
import { Plots } from "./plots.js";
import { listen } from "./pointer.js";
import { digest, rows, toArray } from "./policies.js";
import { Stage } from "./scene.js";

const SLOTS = ["a", "b"];
const YOURS = "#c2185b"; // the visitor's colour
const PLOT_PERIOD = 50; // [ms]
const PUSHES = { left: [0, 1, 0], right: [0, -1, 0], forward: [1, 0, 0], back: [-1, 0, 0], up: [0, 0, 1] };
const ARROWS = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "forward", ArrowDown: "back", PageUp: "up" };
const BEATS = ["f", "j"];

// Begin, with the page's content, what has its policies and its simulator, and `said(text)` that tells of
// progress.
export async function begin(content, parts, said) {
  const page = new Page(content, parts);
  said("starting MuJoCo");
  await page.ready;
  await page.choose(parse(location.hash, content, page.state));
  return page;
}

class Page {
  constructor(content, parts) {
    Object.assign(this, { content, parts, frames: [null, null], robots: [null, null] });
    this.robot = Object.keys(content.robots)[0];
    this.dt = content.task.dt;
    const running = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.state = { a: this.usual(), b: null, speed: 1, running, levels: {}, moment: null };
    this.policies = new Map();
    this.physics = new Physics(parts.simulator(content), {
      ready: ({ version }) => this.begun(version),
      robot: (message) => this.placed(message),
      frame: (message) => this.show(message),
      failure: (text) => fail(text),
    });
    this.ready = new Promise((resolve) => (this.begun = resolve));
    this.build();
  }

  // Return the best learner's champion, or the first agent's.
  usual() {
    const own = ([, { seeds }]) => seeds[0].starts.reduce((sum, start) => sum + start.return, 0);
    const agents = Object.entries(this.content.agents);
    const learners = agents.filter(([, { learns }]) => learns);
    const [agent, { seeds }] = (learners.length ? learners : agents).sort((one, other) => own(other) - own(one))[0];
    return { agent, seed: seeds[0].seed, start: 0 };
  }

  build() {
    const { content } = this;
    this.plots = new Plots(element("plots"));
    const canvas = element("stage"), context = canvas.getContext("webgl2", { antialias: true });
    canvas.hidden = !context;
    element("no-webgl").hidden = Boolean(context); // without, the numbers and the plots go on
    if (context) {
      this.stage = new Stage(canvas, context, [element("label-0"), element("label-1")]);
      listen(this.stage, (slot, target) => this.pull(slot, target));
    }
    this.choosers = SLOTS.map((name) => new Chooser(name, content, (chosen) => this.choose({ [name]: chosen })));
    this.sliders = new Sliders(element("sliders"), content.sliders, (levels) => this.perturb(levels));
    this.commands = new Commands(element("commands"), content.task.commands, (i) => this.command(i));
    this.game = new Game(this, {
      section: element("game"), start: element("game-start"), rival: element("game-rival"),
      beats: [element("beat-0"), element("beat-1")], score: element("game-score"), result: element("game-result"),
    });
    element("run").onclick = () => this.run(!this.state.running);
    element("step").onclick = () => this.step();
    element("restart").onclick = () => this.restart();
    element("speed").onchange = (event) => this.run(this.state.running, Number(event.target.value));
    element("usual").onclick = () => this.perturb({}, true);
    element("full").onchange = () => this.command(this.chosen ?? 0);
    element("link").onclick = () => this.copyLink();
    element("describe").onclick = () => this.describe();
    for (const name of Object.keys(PUSHES)) element(`push-${name}`).onclick = () => this.push(name);
    document.addEventListener("keydown", (event) => this.key(event));
    addEventListener("hashchange", () => {
      if (location.hash.slice(1) !== this.hash) this.choose(parse(location.hash, content, this.state));
    });
    requestAnimationFrame((now) => this.draw(now));
  }

  // Take over a part of the state; robots whose choice is in it begin anew. One whose policy cannot be had
  // leaves the slot as it is.
  async choose(part) {
    const before = { ...this.state };
    Object.assign(this.state, part);
    const { state } = this;
    this.physics.tell("perturb", { levels: state.levels });
    this.sliders.show(state.levels);
    const moments = new Map(state.moment ?? []);
    for (const [slot, name] of SLOTS.entries()) {
      if (name in part && !(await this.place(slot, state[name], moments.get(slot)))) state[name] = before[name];
      this.choosers[slot].show(state[name]);
    }
    state.moment = null;
    element("driving").hidden = !SLOTS.some((name) => state[name]?.agent === "you");
    if (Object.keys(part).some((name) => SLOTS.includes(name)) && !moments.size) this.restart();
    this.run(state.running, state.speed);
  }

  // Put a robot into a slot, or none; return whether its policy could be had.
  async place(slot, chosen, moment) {
    const agent = this.content.agents[chosen?.agent];
    const robot = chosen && (agent?.robot ?? this.robot);
    const policy = agent ? await this.policy(chosen.agent, chosen.seed).catch(() => undefined) : null;
    if (policy === undefined) return false;
    this.robots[slot] = chosen && { label: agent?.label ?? "you", colour: agent?.colour ?? YOURS, policy };
    this.frames[slot] = null;
    this.plots.place(slot, null);
    this.stage?.place(slot, null);
    element(`robot-${SLOTS[slot]}`).hidden = !chosen;
    this.physics.tell("place", { slot, robot, policy, start: chosen && this.startOf(SLOTS[slot]), moment });
    if (chosen) this.tell(slot, chosen, policy);
    return true;
  }

  // Return a slot's start; the visitor's is that of the other robot.
  startOf(name) {
    const own = this.state[name], other = this.state[name === "a" ? "b" : "a"];
    const chosen = own.agent !== "you" ? own : other && other.agent !== "you" ? other : this.usual();
    const seeds = this.content.agents[chosen.agent].seeds;
    return seeds.find((one) => one.seed === chosen.seed).starts[chosen.start];
  }

  placed({ slot, geoms, motors }) {
    const robot = this.robots[slot];
    if (!robot) return;
    robot.motors = motors;
    this.plots.place(slot, robot);
    this.stage?.place(slot, geoms, robot.colour);
    element(`label-${slot}`).textContent = robot.label;
  }

  // Return a seed's policy; if it cannot be had now, say why, and ask again the next time.
  async policy(agent, seed) {
    const name = `${agent}/${seed}`;
    if (!this.policies.has(name)) this.policies.set(name, this.parts.json(name));
    try {
      return await this.policies.get(name);
    } catch (error) {
      this.policies.delete(name);
      say(error.message);
      throw error;
    }
  }

  // Return the kind of an agent's policies.
  kind(agent) {
    return this.content.agents[agent].kind;
  }

  // Return the torques between which a metronome alternates.
  async rhythm(agent) {
    const { arrays } = await this.policy(agent, this.content.agents[agent].seeds[0].seed);
    const commands = rows(toArray(arrays.commands));
    return [...new Map(commands.map((own) => [String(own), own])).values()].slice(0, 2);
  }

  outrun(agent, start, steps) {
    const { robot, seeds } = this.content.agents[agent];
    return this.policy(agent, seeds[0].seed).then((policy) => this.physics.ask("outrun", { robot, policy, start, steps }));
  }

  // Say whose robot a slot has, and check its policy's digest.
  async tell(slot, chosen, policy) {
    const name = SLOTS[slot], origin = element(`origin-${name}`), save = element(`save-${name}`);
    const start = this.startOf(name);
    element(`name-${name}`).textContent = this.robots[slot].label;
    const before = start.length ? `${start.return.toFixed(1)} in ${start.length} steps` : "not evaluated";
    element(`native-${name}`).textContent = policy ? before : "nobody drives it there";
    save.hidden = !policy;
    origin.textContent = "";
    if (!policy) return;
    save.href = URL.createObjectURL(new Blob([JSON.stringify(policy)], { type: "application/json" }));
    save.download = `${chosen.agent}-${chosen.seed}.json`;
    const found = await digest(policy);
    origin.textContent = found === policy.sha256
      ? `SHA-256 ${found.slice(0, 12)}…, recomputed here` : `damaged: SHA-256 ${found}, not ${policy.sha256}`;
    origin.title = found;
  }

  run(running, speed = this.state.speed) {
    Object.assign(this.state, { running, speed });
    element("run").textContent = running ? "Pause" : "Run";
    element("speed").value = speed;
    this.physics.tell("run", { running, speed });
    this.remember();
  }

  step() {
    this.run(false);
    this.physics.tell("step");
  }

  restart() {
    this.physics.tell("restart");
  }

  perturb(levels, isNew = false) {
    this.state.levels = levels;
    if (isNew) this.sliders.show(levels);
    this.physics.tell("perturb", { levels });
    this.remember();
  }

  command(number) {
    this.chosen = number;
    this.commands.show(number);
    const factor = element("full").checked ? 1 : 0.5;
    this.drive(this.content.task.commands[number].map((own) => factor * own));
  }

  drive(torques) {
    this.physics.tell("drive", { torques });
  }

  push(name) {
    const strength = Number(element("strength").value);
    this.physics.tell("push", { force: PUSHES[name].map((own) => strength * own) });
    say(`pushed ${name} with ${strength} N`);
  }

  pull(slot, target) {
    this.physics.tell("pull", { slot, target });
    this.stage.pull(slot, target);
  }

  key(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches("select, input:not([type=checkbox])")) return;
    const number = Number(key);
    const beat = BEATS.indexOf(key.toLowerCase());
    if (target.matches("#stage") && key in ARROWS) this.push(ARROWS[key]);
    else if (this.game.running && beat >= 0) this.game.beat(beat);
    else if (number >= 1 && number <= this.content.task.commands.length) this.command(number - 1);
    else if (key === " " && !target.matches("button, a, summary, input")) this.run(!this.state.running);
    else if (key === ".") this.step();
    else if (key === "r") this.restart();
    else if (key === "d") this.describe();
    else return;
    event.preventDefault();
  }

  show({ frames, share }) {
    this.news = true;
    for (const frame of frames) {
      const before = this.frames[frame.slot];
      this.frames[frame.slot] = { ...frame, share };
      if (!this.robots[frame.slot]?.motors) continue;
      this.plots.add(frame.slot, frame.reports);
      if (frame.ended && before && !before.ended) {
        say(`${this.robots[frame.slot].label}: the episode ended after ${frame.steps} steps, return ${frame.total.toFixed(1)}`);
      }
    }
    const shown = this.frames.filter((own, slot) => own && this.robots[slot]);
    this.game.follow(this.frames[0]?.steps ?? 0, shown.map((own) => own.total), this.frames[0]?.ended);
    if (this.hasMoved === undefined && frames.some((own) => own.steps > 0)) this.hasMoved = performance.now();
  }

  draw(now) {
    requestAnimationFrame((next) => this.draw(next));
    if (this.news) {
      this.frames.forEach((frame, slot) => {
        if (frame) this.stage?.move(slot, frame.previous, frame.current, frame.share);
      });
      this.news = false;
      this.unplotted = true;
    }
    this.stage?.draw();
    if (!this.unplotted || now - (this.plotted ?? 0) < PLOT_PERIOD) return;
    this.plotted = now;
    this.unplotted = false;
    this.plots.draw();
    this.frames.forEach((frame, slot) => {
      if (frame && this.robots[slot]) {
        const more = frame.ended ? ", ended" : "";
        element(`here-${SLOTS[slot]}`).textContent = `${frame.total.toFixed(1)} after ${frame.steps} steps${more}`;
      }
    });
  }

  // Say what each robot does, for those who do not see it.
  describe() {
    const told = this.frames.map((frame, slot) => {
      const robot = this.robots[slot], last = this.plots.histories[slot].at(-1);
      if (!frame || !robot || !last) return null;
      const contact = last.contacts ? `touches the floor at ${last.contacts} points` : "is in the air";
      return `${robot.label}: torso at ${last.height.toFixed(2)} m, ${contact}, return ${frame.total.toFixed(0)} after ${frame.steps} steps`;
    });
    say(told.filter((own) => own).join(". ") || "no robot is there");
  }

  remember() {
    this.hash = format(this.state);
    history.replaceState(null, "", `#${this.hash}`);
  }

  // Copy a link to this very moment: robots, perturbations, and the robots' exact states.
  async copyLink() {
    const moment = await this.physics.ask("save");
    this.hash = format({ ...this.state, moment });
    history.replaceState(null, "", `#${this.hash}`);
    try {
      await navigator.clipboard.writeText(location.href);
      say("the link to this moment is copied");
    } catch {
      say("the link to this moment is in the address bar");
    }
  }
}

function say(text) {
  element("status").textContent = text;
}

function fail(text) {
  element("failure").hidden = false;
  element("failure").textContent = `This page cannot run here: ${text}`;
}
