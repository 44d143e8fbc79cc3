// Policies from their JSON (docs/live-page.md): observations in, torques over peak torques out.

import { Generator } from "./generator.js";

const KINDS = { float32: Float32Array, float64: Float64Array };

// Return the numbers of a JSON array, with its shape.
export function toArray(json) {
  const kind = Object.keys(KINDS).find((name) => name in json);
  return Object.assign(new KINDS[kind](toBytes(json[kind]).buffer), { shape: json.shape });
}

export function toBytes(base64) {
  return Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
}

// Return the SHA-256 of a policy's numbers, in hexadecimal, as its JSON states it.
export async function digest(json) {
  const parts = Object.values(json.arrays).map((own) => toBytes(own.float32 ?? own.float64));
  const all = new Uint8Array(await new Blob(parts).arrayBuffer());
  const found = new Uint8Array(await crypto.subtle.digest("SHA-256", all));
  return [...found].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// Return a policy with `hold`, `start(episodeSeed)` and `act(observation)` for a robot of some motors.
export function load(json, numMotors) {
  const arrays = Object.fromEntries(Object.entries(json.arrays).map(([name, own]) => [name, toArray(own)]));
  const actions = new Actions(json.actions, arrays.commands, numMotors);
  return new POLICIES[json.kind](json, arrays, actions);
}

// What a policy chooses from, as `jumping_ant.policies.actions.ActionSet`.
class Actions {
  constructor({ kind, amplitude, hold, levels }, commands, numMotors) {
    Object.assign(this, { kind, amplitude, hold, levels, numMotors });
    this.commands = commands && rows(commands);
  }

  // Return the torques of what the outputs choose: the nearest level, the largest of all commands, or themselves.
  nearest(outputs) {
    if (this.kind === "commands") return this.best(outputs);
    if (this.kind === "torques") return outputs.map((own) => this.amplitude * Math.max(-1, Math.min(1, own)));
    const last = this.levels - 1;
    return outputs.map((own) => {
      let level = 0;
      while (level < last && own >= -1 + (2 * level + 1) / last) level++;
      return this.level(level);
    });
  }

  // Return the torques of the highest value, among all commands or among each motor's levels.
  best(values) {
    if (this.kind === "commands") return this.commands[largest(values)];
    return Float64Array.from({ length: this.numMotors }, (_, motor) =>
      this.level(largest(values.subarray(motor * this.levels, (motor + 1) * this.levels))));
  }

  draw(generator) {
    if (this.kind === "commands") return this.commands[generator.integer(this.commands.length)];
    return Float64Array.from({ length: this.numMotors }, () =>
      this.kind === "levels"
        ? this.level(generator.integer(this.levels))
        : this.amplitude * generator.uniform(-1, 1));
  }

  level(choice) {
    return this.amplitude * ((2 / (this.levels - 1)) * choice - 1);
  }
}

// A fully connected network, or with one layer a linear map, in single precision.
class Network {
  constructor(json, arrays, actions) {
    Object.assign(this, { output: json.output, actions, arrays, hold: actions.hold });
    this.activate = { none: null, relu: (own) => Math.max(own, 0), tanh: Math.tanh }[json.hidden];
    this.layers = [];
    for (let i = 0; `weight_${i}` in arrays; i++) {
      this.layers.push([rows(arrays[`weight_${i}`], Float32Array), arrays[`bias_${i}`]]);
    }
  }

  start() {}

  act(observation) {
    const outputs = Float64Array.from(this.outputs(observation));
    if (this.output === "tanh") return outputs.map((own) => this.actions.amplitude * Math.fround(Math.tanh(own)));
    return this.actions[this.output](outputs);
  }

  outputs(observation) {
    const { subtract, divide, multiply } = this.arrays;
    let values = Float32Array.from(observation);
    if (subtract) values = values.map((own, i) => own - subtract[i]);
    if (divide) values = values.map((own, i) => own / divide[i]);
    if (multiply) values = values.map((own, i) => own * multiply[i]);
    this.layers.forEach(([weight, bias], number) => {
      values = bias.map((own, i) => own + product(weight[i], values));
      if (number < this.layers.length - 1) values = values.map(this.activate);
    });
    return values;
  }
}

// The commands by turns.
class Cycle {
  constructor(json, arrays, actions) {
    Object.assign(this, { commands: actions.commands, hold: actions.hold });
  }

  start() {
    this.count = 0;
  }

  act() {
    return this.commands[this.count++ % this.commands.length];
  }
}

// An oscillator for each motor, as `jumping_ant.policies.blind.Oscillators`.
class Oscillators {
  constructor(json, arrays, actions) {
    Object.assign(this, { arrays, actions, hold: actions.hold });
  }

  start() {
    this.angles = Float64Array.from(this.arrays.phases);
  }

  act() {
    const { amplitudes, offsets, speeds } = this.arrays;
    const sines = this.angles.map(Math.sin);
    this.angles = this.angles.map((own, i) => own + (sines[i] > 0 ? speeds[0] : speeds[1]));
    return this.actions.nearest(sines.map((own, i) => amplitudes[i] * own + offsets[i]));
  }
}

// Random choices, from the policy's seed and the episode's.
class Uniform {
  constructor(json, arrays, actions) {
    Object.assign(this, { seed: json.noise_seed, actions, hold: actions.hold });
  }

  start(episodeSeed) {
    this.generator = new Generator([this.seed, episodeSeed]);
  }

  act() {
    return this.actions.draw(this.generator);
  }
}

const POLICIES = { network: Network, cycle: Cycle, oscillators: Oscillators, uniform: Uniform };

// Return the rows of a matrix.
export function rows(matrix, kind = Float64Array) {
  const [count, width] = matrix.shape;
  return Array.from({ length: count }, (_, i) => kind.from(matrix.subarray(i * width, (i + 1) * width)));
}

function product(one, other) {
  let total = 0;
  for (let i = 0; i < one.length; i++) total += one[i] * other[i];
  return total;
}

function largest(values) {
  return values.reduce((best, own, i) => (own > values[best] ? i : best), 0);
}
