// The page's state in its address, after the #, so that a link carries all of it.
//
// #a=sac.30.0&b=you..0&speed=0.5&run=1&gravity=1.5&moment=...: agent, seed and start of each robot, then
// speed, whether it runs, perturbations, and the robots' exact states.

const EXACT = 17; // digits after which a number of double precision is the same again

// Return the part of an address after the #.
export function format(state) {
  const parts = new URLSearchParams();
  for (const name of ["a", "b"]) {
    const own = state[name];
    if (own) parts.set(name, [own.agent, own.seed, own.start].join("."));
  }
  if (state.speed !== 1) parts.set("speed", state.speed);
  parts.set("run", Number(state.running));
  for (const [name, level] of Object.entries(state.levels)) parts.set(name, level);
  if (state.moment) parts.set("moment", btoa(JSON.stringify(state.moment, exactly)));
  return String(parts);
}

// Return the state in an address over a state by default; what the page does not know is left out.
export function parse(text, content, usual) {
  const parts = new URLSearchParams(text.replace(/^#/, ""));
  const state = { ...usual, levels: {}, moment: null };
  if (parts.has("a") || parts.has("b")) {
    state.a = robot(parts.get("a"), content) ?? usual.a;
    state.b = robot(parts.get("b"), content);
  }
  const speed = Number(parts.get("speed"));
  if (speed > 0 && speed <= 4) state.speed = speed;
  if (parts.has("run")) state.running = parts.get("run") === "1";
  for (const { name, low, high, usual: level } of content.sliders) {
    const given = parts.has(name) ? Number(parts.get(name)) : level;
    if (given >= low && given <= high && given !== level) state.levels[name] = given;
  }
  state.moment = moment(parts.get("moment"), state, content);
  return state;
}

// Return the moment in an address, as pairs of a slot and what its simulation saved, or else null.
function moment(text, state, content) {
  try {
    const pairs = JSON.parse(atob(text ?? ""));
    const own = [state.a, state.b].map((chosen) => chosen && likeness(chosen.agent, content));
    return pairs.every(([slot, saved]) => isSaved(saved, own[slot], content.task)) ? pairs : null;
  } catch {
    return null;
  }
}

// Return an agent whose robot is that of another one, or of the visitor: with the robot and a start.
function likeness(agent, content) {
  const robot = content.agents[agent]?.robot ?? Object.keys(content.robots)[0];
  const { seeds } = Object.values(content.agents).find((one) => one.robot === robot);
  return { ...content.robots[robot], ...seeds[0].starts[0] };
}

// Tell whether something is what a simulation of such a robot saves.
function isSaved({ steps, total, substep, ended, state, torques }, { qpos, qvel, motors }, task) {
  return isCount(steps, task.max_episode_steps)
    && isCount(substep, ended ? 0 : task.frame_skip - 1)
    && [undefined, false, true].includes(ended)
    && Number.isFinite(total)
    && areNumbers(state, qpos.length + 2 * qvel.length)
    && areNumbers(torques, motors.length);
}

function isCount(given, most) {
  return Number.isInteger(given) && given >= 0 && given <= most;
}

function areNumbers(given, count) {
  return Array.isArray(given) && given.length === count && given.every(Number.isFinite);
}

function robot(text, content) {
  const match = text?.match(/^(.*)\.(\d*)\.(\d+)$/);
  if (!match) return null;
  const [, agent, seed, start] = match;
  if (agent === "you") return { agent, seed: null, start: Number(start) };
  if (!Object.hasOwn(content.agents, agent)) return null;
  const own = content.agents[agent].seeds.find((one) => one.seed === Number(seed));
  return own && own.starts[start] ? { agent, seed: own.seed, start: Number(start) } : null;
}

function exactly(key, value) {
  return typeof value === "number" && !Number.isInteger(value) ? Number(value.toPrecision(EXACT)) : value;
}
