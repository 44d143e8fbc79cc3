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
  try {
    state.moment = parts.has("moment") ? JSON.parse(atob(parts.get("moment"))) : null;
  } catch {
    state.moment = null;
  }
  return state;
}

function robot(text, content) {
  const match = text?.match(/^(.*)\.(\d*)\.(\d+)$/);
  if (!match) return null;
  const [, agent, seed, start] = match;
  if (agent === "you") return { agent, seed: null, start: Number(start) };
  const own = content.agents[agent]?.seeds.find((one) => one.seed === Number(seed));
  return own && own.starts[start] ? { agent, seed: own.seed, start: Number(start) } : null;
}

function exactly(key, value) {
  return typeof value === "number" && !Number.isInteger(value) ? Number(value.toPrecision(EXACT)) : value;
}
