"use strict";

const MAX_SPEED = 8; // rad/s
const TURN = 2 * Math.PI;

/** Gymnasium's Pendulum-v1 with the same operations in the same order: m = 1 kg, l = 1 m. */
class Task {
  constructor({ gravity }) {
    this.gravity = gravity; // m/s²
  }

  timeStep = 0.05; // s
  drivenStep = 0.05; // s on the clock when you drive
  episodeSteps = 200;
  maxEffort = 2; // N·m
  rightward = -1; // the sign of θ to the right, and of the effort that moves it there
  returnDigits = 1;
  curveName = "reward per step";
  // The phase portrait.
  largest = [Math.PI, MAX_SPEED]; // θ in rad, θ̇ in rad/s
  angleTicks = [[-Math.PI, "−π"], [-Math.PI / 2, "−π/2"], [0, "0"], [Math.PI / 2, "π/2"], [Math.PI, "π"]];
  speedTicks = [-8, -4, 0, 4, 8];
  mapSize = 97;
  aimed = []; // the state has no numbers but those of the map
  nudges = [0.1, 0.5]; // rad, rad/s, of a key
  fineNudges = [0.01, 0.1];
  effortTicks = [-2, -1, 0, 1, 2].map((torque) => [torque, shown(torque, 0, torque !== 0)]);
  effortAxis = "torque (N·m)";
  hanging = [Math.PI, 0];
  limits = [Infinity, MAX_SPEED]; // of the state [θ, θ̇]
  readings = [];

  /** Returns a state at random, like Gymnasium. */
  randomStart() {
    return [uniform(Math.PI), uniform(1)];
  }

  /** Returns θ within -π and π. JavaScript's % has the sign of the dividend, NumPy's of the divisor. */
  angle(theta) {
    const rest = (theta + Math.PI) % TURN;
    return (rest < 0 ? rest + TURN : rest) - Math.PI;
  }

  /** Returns the observation: cos θ, sin θ, θ̇ in rad/s. */
  observed([theta, thetadot]) {
    return Float32Array.of(Math.cos(theta), Math.sin(theta), thetadot);
  }

  /** Returns the torques in N·m of the outputs. Like NumPy's linspace: the last one is exact. */
  efforts(count) {
    const step = (2 * this.maxEffort) / (count - 1);
    const torques = Array.from({ length: count }, (_, i) => i * step - this.maxEffort);
    torques[count - 1] = this.maxEffort;
    return torques;
  }

  /** Returns the text of a torque. 41 are multiples of 0.1 N·m; others may need a second digit. */
  effortText(torque, efforts) {
    const coarse = efforts.every((u) => Math.abs(u * 10 - Math.round(u * 10)) < 1e-9);
    return shown(torque, coarse ? 1 : 2, true);
  }

  bestText(torque, efforts) {
    return `${this.effortText(torque, efforts)} N·m`;
  }

  /** Returns the torque that acts when you choose one. */
  acting(torque) {
    return torque;
  }

  /** Returns the state, the reward and whether the episode ends after one time step. */
  advanced([theta, thetadot], torque) {
    const cost = this.angle(theta) ** 2 + 0.1 * thetadot ** 2 + 0.001 * torque ** 2;
    const acceleration = ((3 * this.gravity) / 2) * Math.sin(theta) + 3 * torque;
    const speed = clipped(thetadot + acceleration * this.timeStep, MAX_SPEED);
    return { state: [theta + speed * this.timeStep, speed], reward: -cost, over: false };
  }

  /** Returns which number of the state a pointer moves: always θ. */
  grip() {
    return 0;
  }

  /** Returns θ where a pointer at [x, y] in a canvas of this size is, near the present θ. */
  gripped([theta], grip, [x, y], [width, height]) {
    const angle = Math.atan2(width / 2 - x, height / 2 - y);
    return theta + this.angle(angle - theta);
  }

  /** Returns the text on what a network is for. */
  about(outputs) {
    return `${outputs} torques, on Pendulum-v1 with g = ${this.gravity} m/s².`;
  }
}
