// One robot: MuJoCo's model and state of it, its policy, and what is done to it.

import { Integrator } from "./integrator.js";
import { perturb, sensed, SECOND } from "./perturbations.js";
import { Task } from "./task.js";

const PULL_RATE = 12; // [rad/s] of the undamped spring that pulls the torso, whatever the robot's mass
const XFRC = 6; // numbers of a body's applied force and torque

export class Simulation {
  // `content` is the page's, `kind` the robot's name in it, `mujoco` the WebAssembly module.
  constructor(mujoco, content, kind) {
    this.mujoco = mujoco;
    this.anatomy = content.robots[kind];
    this.settings = content.task;
    this.model = mujoco.MjModel.from_xml_string(this.anatomy.xml);
    this.data = new mujoco.MjData(this.model);
    this.integrator = new Integrator(mujoco, this.model, this.data);
    this.task = new Task(this.settings, this.anatomy, this.model.opt.timestep * this.settings.frame_skip);
    this.usual = copies(this.model);
    this.mass = this.model.body_mass.reduce((sum, own) => sum + own, 0);
    this.levels = {};
    this.target = null; // [m] that the torso is pulled to
    this.shove = null; // { force, steps }: a force on the torso, and for how many simulation steps
  }

  get num_motors() {
    return this.model.nu;
  }

  // Set the levels of perturbations, by name; what is not named is as usual.
  perturb(levels) {
    this.levels = levels;
    perturb(this.mujoco, this.model, this.data, this.anatomy, this.usual, levels);
  }

  // Begin an episode of a policy: `start` has `qpos`, `qvel` and the episode's `seed`.
  reset(policy, start) {
    const { mujoco, model, data } = this;
    mujoco.mj_resetData(model, data);
    data.qpos.set(start.qpos);
    data.qvel.set(start.qvel);
    mujoco.mj_forward(model, data);
    policy.start(start.seed);
    Object.assign(this, { policy, start, steps: 0, substep: 0, ended: false, total: 0 });
    this.x = this.torso(data.xpos)[0];
    this.seen = [];
    this.sent = [];
    this.observation = this.look();
    this.torques = new Float64Array(model.nu);
    const { height, terms } = this.task.judge(data.qpos, data.qvel, this.torques, 0);
    this.outcome = { height, terms, reward: 0, terminated: false };
    this.target = this.shove = null;
  }

  // Advance by a simulation step; return whether it completed a control step.
  advance() {
    if (this.substep === 0) this.decide();
    this.apply();
    this.integrator.step();
    this.substep = (this.substep + 1) % this.settings.frame_skip;
    if (this.substep) return false;
    this.finish();
    return true;
  }

  // Advance by a control step.
  step() {
    while (!this.advance());
  }

  // Choose torques, if it is time to, and send them to the motors.
  decide() {
    if (this.steps % this.policy.hold === 0) this.choice = this.policy.act(this.observation);
    this.sent.push(this.choice);
    const delay = this.levels.action_delay ?? 0;
    this.torques = this.sent.at(-1 - delay) ?? new Float64Array(this.model.nu); // none before the first arrives
    if (this.sent.length > 100) this.sent.shift();
    this.data.ctrl.set(this.anatomy.control_limits.map((own, i) => own * this.torques[i]));
  }

  // Set the forces on the torso.
  apply() {
    const { data, model, anatomy } = this;
    const force = [0, 0, 0];
    const push = this.levels.push ?? 0;
    if (push && this.steps % Math.round(SECOND / this.task.dt) === 0) force[0] += push;
    if (this.shove) {
      this.shove.force.forEach((own, i) => (force[i] += own));
      if (--this.shove.steps === 0) this.shove = null;
    }
    if (this.target) {
      const place = this.torso(data.xpos), at = model.body_dofadr[anatomy.torso];
      for (let i = 0; i < 3; i++) {
        const speed = anatomy.num_horizontal === 2 ? data.qvel[at + i] : 0;
        force[i] += this.mass * (PULL_RATE ** 2 * (this.target[i] - place[i]) - PULL_RATE * speed);
      }
    }
    data.xfrc_applied.set(force, anatomy.torso * XFRC);
  }

  // Judge the control step that has ended.
  finish() {
    const { data, settings } = this;
    const x = this.torso(data.xpos)[0];
    this.steps++;
    this.outcome = this.task.judge(data.qpos, data.qvel, this.torques, x - this.x);
    this.x = x;
    this.total += this.outcome.reward;
    this.ended = this.outcome.terminated || this.steps >= settings.max_episode_steps;
    this.observation = this.look();
  }

  // Return what the policy sees.
  look() {
    this.seen.push(this.task.observe(this.data.qpos, this.data.qvel));
    if (this.seen.length > 100) this.seen.shift();
    return sensed(this.seen, this.levels, this.model.nq - this.anatomy.num_horizontal);
  }

  torso(array) {
    return array.subarray(3 * this.anatomy.torso, 3 * this.anatomy.torso + 3);
  }

  // Return everything that later steps depend on, but for delayed values, as JSON.
  save() {
    const { data, steps, total, substep, ended } = this;
    const state = [...data.qpos, ...data.qvel, ...data.qacc_warmstart];
    return { steps, total, substep, ended, state, torques: [...this.torques] };
  }

  // Resume from what `save` returned, after a `reset` with the same policy and start.
  restore({ steps, total, substep, ended = false, state, torques }) {
    const { data, model, mujoco } = this;
    for (let step = 0; step < steps + (substep > 0); step += this.policy.hold) {
      this.choice = this.policy.act(this.observation); // for policies that count or draw
    }
    data.qpos.set(state.slice(0, model.nq));
    data.qvel.set(state.slice(model.nq, model.nq + model.nv));
    mujoco.mj_forward(model, data);
    data.qacc_warmstart.set(state.slice(model.nq + model.nv));
    Object.assign(this, { steps, total, substep, ended, seen: [], torques: Float64Array.from(torques) });
    this.choice = this.torques;
    this.sent = [this.torques];
    data.ctrl.set(this.anatomy.control_limits.map((own, i) => own * torques[i]));
    this.x = this.torso(data.xpos)[0];
    this.observation = this.look();
    const { height, terms } = this.task.judge(data.qpos, data.qvel, this.torques, 0);
    this.outcome = { height, terms, reward: 0, terminated: false };
  }

  delete() {
    this.integrator.delete();
    this.data.delete();
    this.model.delete();
  }
}

function copies(model) {
  const own = ["body_mass", "body_inertia", "geom_friction", "dof_damping", "actuator_gear"];
  const found = Object.fromEntries(own.map((name) => [name, Float64Array.from(model[name])]));
  return { ...found, gravity: Float64Array.from(model.opt.gravity) };
}
