// MuJoCo 4.0's Runge-Kutta method over MuJoCo's own `mj_forward`, where the build of npm has an older one.
//
// Positions with orientations are no vectors. Munthe-Kaas, "High order Runge-Kutta methods on manifolds",
// Applied Numerical Mathematics 29, 1999: integrate u with exp(u) the rotation since the step began, in the
// body's frame. Its derivative is the inverse of the derivative of exp, at u, applied to the body's angular
// velocity w: w + u x w / 2 + c u x (u x w), with c = (1 - |u|/2 cot(|u|/2)) / |u|^2.

const A = [[], [0.5], [0, 0.5], [0, 0, 1]];
const B = [1 / 6, 1 / 3, 1 / 3, 1 / 6];
const SMALL = 1e-4; // [rad] below it, c is 1/12 up to rounding
const FREE = 0, BALL = 1; // of mjtJoint
const NO_STAGE = 0, SKIP_SENSORS = 1; // for `mj_forwardSkip`

export class Integrator {
  // Steps `data` of `model`; `mujoco` is the WebAssembly module.
  constructor(mujoco, model, data) {
    Object.assign(this, { mujoco, model, data });
    const { nv, nq } = model;
    this.isRungeKutta = model.opt.integrator === mujoco.mjtIntegrator.mjINT_RK4.value;
    this.rotations = []; // addresses of angular velocities that turn a quaternion
    for (let joint = 0; joint < model.njnt; joint++) {
      const kind = model.jnt_type[joint];
      if (kind === FREE) this.rotations.push(model.jnt_dofadr[joint] + 3);
      if (kind === BALL) this.rotations.push(model.jnt_dofadr[joint]);
    }
    const vectors = (size) => Array.from({ length: 4 }, () => new Float64Array(size));
    this.start = { qpos: new Float64Array(nq), qvel: new Float64Array(nv) };
    this.rates = vectors(nv); // of positions, in each stage
    this.accelerations = vectors(nv);
    this.turn = new Float64Array(nv);
    this.position = new mujoco.DoubleBuffer(nq);
  }

  // Advance by a simulation step.
  step() {
    const { mujoco, model, data, start, rates, accelerations } = this;
    if (!this.isRungeKutta) {
      mujoco.mj_step(model, data);
      return;
    }
    const step = model.opt.timestep, time = data.time;
    mujoco.mj_forward(model, data);
    start.qpos.set(data.qpos);
    start.qvel.set(data.qvel);
    rates[0].set(start.qvel);
    accelerations[0].set(data.qacc);
    for (let stage = 1; stage < 4; stage++) {
      this.move(A[stage], step);
      data.time = time + A[stage].at(-1) * step;
      mujoco.mj_forwardSkip(model, data, NO_STAGE, SKIP_SENSORS);
      rates[stage].set(data.qvel);
      accelerations[stage].set(data.qacc);
      for (const address of this.rotations) correct(rates[stage], this.turn, address, step);
    }
    this.move(B, step);
    data.time = time + step;
    data.qacc_warmstart.set(data.qacc);
  }

  // Set the state to that at the step's start, moved along a weighted sum of rates for a step.
  move(weights, step) {
    const { mujoco, model, data, start, turn } = this;
    const velocity = new Float64Array(turn.length);
    turn.fill(0);
    weights.forEach((weight, stage) => {
      for (let i = 0; i < turn.length; i++) {
        turn[i] += weight * this.rates[stage][i];
        velocity[i] += weight * this.accelerations[stage][i];
      }
    });
    for (let i = 0; i < velocity.length; i++) velocity[i] = start.qvel[i] + step * velocity[i];
    data.qvel.set(velocity);
    const position = this.position.GetView();
    position.set(start.qpos);
    mujoco.mj_integratePos(model, this.position, turn, step);
    data.qpos.set(this.position.GetView());
  }

  delete() {
    this.position.delete();
  }
}

// Turn an angular velocity into the derivative of the rotation vector `step` times `turn`.
function correct(rate, turn, at, step) {
  const u = [step * turn[at], step * turn[at + 1], step * turn[at + 2]];
  const angle = Math.hypot(...u);
  const factor = angle < SMALL ? 1 / 12 : (1 - angle / 2 / Math.tan(angle / 2)) / angle ** 2;
  const once = cross(u, rate.subarray(at, at + 3));
  const twice = cross(u, once);
  for (let i = 0; i < 3; i++) rate[at + i] += once[i] / 2 + factor * twice[i];
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
