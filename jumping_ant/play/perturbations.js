// Perturbations that a number sets, as `jumping_ant.sim.perturbations` applies them. What is drawn for each
// episode there is fixed here: slopes rise and pushes go along x. Noise is the browser's own.

export const SECOND = 1; // [s] from push to push
const VELOCITY_NOISE = 10; // times that of positions

// Set a model's numbers to its usual ones, perturbed.
export function perturb(mujoco, model, data, anatomy, usual, levels) {
  const { torso_mass, friction = 1, gravity = 1, slope = 0, damping = 1, motor_strength = 1 } = levels;
  const { torso } = anatomy;
  const mass = torso_mass ?? usual.body_mass[torso];
  model.body_mass.set(usual.body_mass);
  model.body_inertia.set(usual.body_inertia);
  model.body_mass[torso] = mass;
  for (let i = 3 * torso; i < 3 * torso + 3; i++) model.body_inertia[i] *= mass / usual.body_mass[torso];
  model.geom_friction.set(usual.geom_friction.map((own, i) => (i % 3 ? own : own * friction)));
  model.dof_damping.set(usual.dof_damping.map((own) => own * damping));
  model.actuator_gear.set(usual.actuator_gear.map((own) => own * motor_strength));
  const angle = (slope * Math.PI) / 180;
  const strength = gravity * Math.hypot(...usual.gravity);
  model.opt.gravity.set(
    slope ? [strength * Math.sin(angle), 0, -strength * Math.cos(angle)] : usual.gravity.map((own) => own * gravity));
  const state = [data.qpos, data.qvel].map((own) => Float64Array.from(own));
  mujoco.mj_setConst(model, data); // it leaves the data in the robot's initial pose
  data.qpos.set(state[0]);
  data.qvel.set(state[1]);
}

// Return what a policy sees, of all observations so far.
export function sensed(seen, { observation_delay = 0, observation_noise = 0 }, numPositions) {
  const latest = seen.at(-1 - observation_delay) ?? seen[0];
  if (!observation_noise) return latest;
  return latest.map((own, i) => own + observation_noise * (i < numPositions ? 1 : VELOCITY_NOISE) * normal());
}

// Draw from the normal distribution (Box and Muller 1958).
function normal() {
  return Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
}
