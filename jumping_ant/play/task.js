// The task, as `jumping_ant.sim.task` and `jumping_ant.sim.rewards` define it, of one robot.

const TERMS = {
  torso_height: (step, { floor, span }) => Math.min(Math.max((step.height - floor) / span, 0), 1),
  forward_velocity: (step) => step.velocity,
  alive: (step) => (step.terminated ? 0 : 1),
  control_cost: (step) => -step.torques.reduce((total, own) => total + own * own, 0),
  upright: (step) => step.uprightness,
};

export class Task {
  // `settings` is the task, and `anatomy` the robot, of the page's content; `dt` a control step [s].
  constructor(settings, anatomy, dt) {
    Object.assign(this, { settings, anatomy, dt });
  }

  height(qpos) {
    return qpos[this.anatomy.height_address] + this.anatomy.height_offset;
  }

  uprightness(qpos) {
    const turned = qpos.subarray(...this.anatomy.orientation);
    if (turned.length === 1) return Math.cos(turned[0] - this.anatomy.level);
    const squares = turned.map((own) => own * own);
    return 1 - (2 * (squares[1] + squares[2])) / (squares[0] + squares[1] + squares[2] + squares[3]);
  }

  observe(qpos, qvel) {
    const observed = [...qpos.subarray(this.anatomy.num_horizontal), ...qvel];
    return Float64Array.from(observed, (own) => (Number.isFinite(own) ? own : 0));
  }

  // Return the height, the terms of the reward, their sum, and whether the episode ended, after a control
  // step that held the torques and moved the torso by `travel` along x [m].
  judge(qpos, qvel, torques, travel) {
    const { min_torso_height: low, max_torso_height: high, max_tilt: tilt, reward } = this.settings;
    const step = { height: this.height(qpos), uprightness: this.uprightness(qpos), torques };
    const finite = qpos.every(Number.isFinite) && qvel.every(Number.isFinite);
    step.velocity = travel / this.dt;
    step.terminated = !finite
      || (low !== null && step.height < low)
      || (high !== null && step.height > high)
      || (tilt !== null && step.uprightness < Math.cos(tilt));
    const terms = {};
    for (const [name, own] of Object.entries(reward)) terms[name] = finite ? own.weight * TERMS[name](step, own) : 0;
    const total = Object.values(terms).reduce((sum, own) => sum + own, 0);
    return { height: step.height, terms, reward: total, terminated: step.terminated };
  }
}
