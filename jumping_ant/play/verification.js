// How far this physics and these policies are from the native ones, which recorded the reference
// (`tests/play/native.py`). Node and browsers run it alike.

import { load, toArray } from "./policies.js";
import { Simulation } from "./simulation.js";

const CLOSE = 1e-6; // [m, rad, m/s, rad/s] at which trajectories count as diverged

// Return the errors of one agent: its policy is `policy`, and `reference` what the native one did.
export function verify(mujoco, content, { policy, reference }) {
  const simulation = new Simulation(mujoco, content, reference.robot);
  const acting = load(policy, simulation.num_motors);
  try {
    return {
      one_step_error: oneStepError(simulation, reference),
      ...divergence(simulation, reference),
      policy_error: policyError(acting, reference),
    };
  } finally {
    simulation.delete();
  }
}

// Return the return of a policy's episode from each start, with perturbations by name.
export function returns(mujoco, content, { robot, policy, starts, levels = {} }) {
  const simulation = new Simulation(mujoco, content, robot);
  simulation.perturb(levels);
  const acting = load(policy, simulation.num_motors);
  try {
    return starts.map((start) => {
      simulation.reset(acting, start);
      while (!simulation.ended) simulation.step();
      return simulation.total;
    });
  } finally {
    simulation.delete();
  }
}

// Return the largest error of a control step from each recorded state.
function oneStepError(simulation, { before, after, controls }) {
  const { data, model, integrator, settings } = simulation;
  const [from, to, ctrl] = [before, after, controls].map(toArray);
  const width = model.nq + 2 * model.nv;
  let largest = 0;
  for (let row = 0; row < before.shape[0]; row++) {
    const state = from.subarray(row * width, (row + 1) * width);
    data.qpos.set(state.subarray(0, model.nq));
    data.qvel.set(state.subarray(model.nq, model.nq + model.nv));
    data.qacc_warmstart.set(state.subarray(model.nq + model.nv));
    data.ctrl.set(ctrl.subarray(row * model.nu, (row + 1) * model.nu));
    for (let i = 0; i < settings.frame_skip; i++) integrator.step();
    largest = Math.max(largest, error(data, to, row));
  }
  return largest;
}

// Return the largest error over the first simulation steps of some episodes with the native torques, and
// how many steps the first of them takes to diverge; if none does, that is their length.
function divergence(simulation, { rollouts, steps }) {
  let largest = 0, horizon = Infinity;
  for (const { start, states, torques } of rollouts) {
    const native = toArray(states);
    simulation.reset(replayed(torques), start);
    for (let row = 0; row < states.shape[0]; row++) {
      simulation.advance();
      const own = error(simulation.data, native, row);
      if (row < steps) largest = Math.max(largest, own);
      if (!(own < CLOSE)) {
        horizon = Math.min(horizon, row);
        break;
      }
      if (row + 1 === states.shape[0]) horizon = Math.min(horizon, states.shape[0]);
    }
  }
  return { max_error: largest, horizon };
}

// Return a policy that plays recorded torques.
function replayed(torques) {
  const rows = toArray(torques), width = torques.shape[1];
  let row = 0;
  return { hold: 1, start() {}, act: () => rows.subarray(row * width, ++row * width) };
}

function error({ qpos, qvel }, native, row) {
  const at = row * (qpos.length + qvel.length);
  let largest = 0;
  for (let i = 0; i < qpos.length; i++) largest = Math.max(largest, Math.abs(qpos[i] - native[at + i]));
  for (let i = 0; i < qvel.length; i++) {
    largest = Math.max(largest, Math.abs(qvel[i] - native[at + qpos.length + i]));
  }
  return largest;
}

// Return the largest difference of torques over peak torques from the same observations.
function policyError(policy, { observations, torques, start }) {
  const [seen, native] = [observations, torques].map(toArray);
  const [count, width] = observations.shape, motors = torques.shape[1];
  let largest = 0;
  policy.start(start);
  for (let row = 0; row < count; row++) {
    const own = policy.act(seen.subarray(row * width, (row + 1) * width));
    for (let i = 0; i < motors; i++) largest = Math.max(largest, Math.abs(own[i] - native[row * motors + i]));
  }
  return largest;
}
