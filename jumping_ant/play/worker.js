// The physics, in a worker: on the page's own thread it would keep the page from drawing and listening.

import loadMujoco from "mujoco";

import { load } from "./policies.js";
import { Simulation } from "./simulation.js";
import { verify } from "./verification.js";

const TICK = 8; // [ms] between looks at the clock
const MOST = 12; // [ms] of simulating in a row, so that messages are read
const PUSH_SECONDS = 0.05;

let mujoco, content;
const slots = new Map(); // by number: { simulation, policy, previous, report }
let running = false, speed = 1, debt = 0, last = 0, levels = {}, visitor = null;

const listeners = {
  async begin({ binary, content: given }) {
    mujoco = await loadMujoco({ wasmBinary: binary, locateFile: (name) => name });
    content = given;
    visitor = content.task.commands[0];
    post({ kind: "ready", version: mujoco.mj_versionString() });
    last = performance.now();
    setInterval(tick, TICK);
  },

  // Put a robot into a slot, or with `robot` null none.
  place({ slot, robot, policy, start, moment }) {
    slots.get(slot)?.simulation.delete();
    slots.delete(slot);
    if (!robot) return;
    const simulation = new Simulation(mujoco, content, robot);
    const acting = policy ? load(policy, simulation.num_motors) : new Visitor();
    simulation.perturb(levels);
    const own = { simulation, policy: acting, slot };
    slots.set(slot, own);
    restart(own, start, moment);
    post({ kind: "robot", slot, geoms: geoms(simulation.model), motors: simulation.anatomy.motors });
    show();
  },

  restart() {
    for (const own of slots.values()) restart(own, own.simulation.start);
    debt = 0;
    show();
  },

  run(message) {
    running = message.running;
    speed = message.speed;
    debt = 0;
    last = performance.now();
  },

  // Advance all robots by a control step.
  step() {
    for (const own of slots.values()) {
      do advance(own); while (own.simulation.substep);
    }
    debt = 0;
    show();
  },

  perturb(message) {
    levels = message.levels;
    for (const { simulation } of slots.values()) simulation.perturb(levels);
  },

  // Set the torques of robots that the visitor drives.
  drive({ torques }) {
    visitor = torques;
  },

  pull({ slot, target }) {
    const own = slots.get(slot);
    if (own) own.simulation.target = target;
  },

  push({ force }) {
    for (const { simulation } of slots.values()) {
      const steps = Math.max(1, Math.round(PUSH_SECONDS / simulation.model.opt.timestep));
      simulation.shove = { force, steps };
    }
  },

  // Play an episode of some control steps as fast as it goes, and post its return.
  outrun({ robot, policy, start, steps }) {
    const simulation = new Simulation(mujoco, content, robot);
    simulation.perturb(levels);
    simulation.reset(load(policy, simulation.num_motors), start);
    while (!simulation.ended && simulation.steps < steps) simulation.step();
    post({ kind: "answer", answer: simulation.total });
    simulation.delete();
  },

  save() {
    post({ kind: "answer", answer: [...slots].map(([slot, own]) => [slot, own.simulation.save()]) });
  },

  verify(task) {
    post({ kind: "answer", answer: verify(mujoco, content, task) });
  },
};

// The visitor, who drives a robot with torques that stay until others are chosen.
class Visitor {
  hold = 1;

  start() {}

  act() {
    return Float64Array.from(visitor);
  }
}

// Do what a message of the page says.
export async function hear(message) {
  try {
    await listeners[message.kind](message);
  } catch (error) {
    post({ kind: "failure", text: String(error?.message ?? error) });
    throw error;
  }
}

function post(message) {
  postMessage(message);
}

function restart(own, start, moment) {
  own.simulation.reset(own.policy, start);
  if (moment) own.simulation.restore(moment);
  own.previous = own.current = pose(own.simulation);
  own.reports = [report(own.simulation)];
}

// Simulate what time has passed; if the machine is too slow for that, time passes more slowly here.
function tick() {
  const now = performance.now(), passed = (now - last) / 1000;
  last = now;
  if (!running || !slots.size) return;
  debt = Math.min(debt + speed * passed, 0.1 * Math.max(1, speed));
  const timestep = [...slots.values()][0].simulation.model.opt.timestep;
  while (debt >= timestep && performance.now() - now < MOST) {
    for (const own of slots.values()) advance(own);
    debt -= timestep;
  }
  show(Math.min(1, debt / timestep));
}

function advance(own) {
  const { simulation } = own;
  if (simulation.ended) {
    own.previous = own.current;
    return;
  }
  own.previous = own.current;
  if (simulation.advance()) own.reports.push(report(simulation));
  own.current = pose(simulation);
}

// Post where the robots are, `share` of the way from the last step's place to the present one.
function show(share = 1) {
  const frames = [...slots.values()].map((own) => {
    const { slot, previous, current, simulation, reports } = own;
    own.reports = [];
    return { slot, previous, current, reports, steps: simulation.steps, total: simulation.total, ended: simulation.ended };
  });
  post({ kind: "frame", share, frames });
}

// Return where all parts are, before or after a step: their places and turns.
function pose({ data, anatomy }) {
  const torso = 3 * anatomy.torso;
  return {
    places: Float32Array.from(data.geom_xpos),
    turns: Float32Array.from(data.geom_xmat),
    torso: [...data.xpos.subarray(torso, torso + 3)],
  };
}

// Return what the plots show of a control step.
function report({ outcome, torques, data, steps, task }) {
  return { time: steps * task.dt, ...outcome, torques: Float32Array.from(torques), contacts: data.ncon };
}

// Return the shapes of a robot's parts.
function geoms(model) {
  return Array.from({ length: model.ngeom }, (_, i) => ({
    type: model.geom_type[i],
    size: [...model.geom_size.subarray(3 * i, 3 * i + 3)],
    colour: [...model.geom_rgba.subarray(4 * i, 4 * i + 4)],
    world: model.geom_bodyid[i] === 0,
  }));
}
