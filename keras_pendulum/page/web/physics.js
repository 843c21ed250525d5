"use strict";

// Gymnasium's Pendulum-v1 with the same operations in the same order: m = 1 kg, l = 1 m.
const TIME_STEP = 0.05; // s
const MAX_SPEED = 8; // rad/s
const MAX_TORQUE = 2; // N·m
const EPISODE_STEPS = 200;

/** Returns θ within -π and π. JavaScript's % has the sign of the dividend, NumPy's of the divisor. */
function wrapped(theta) {
  const turn = 2 * Math.PI;
  const rest = (theta + Math.PI) % turn;
  return (rest < 0 ? rest + turn : rest) - Math.PI;
}

function uniform(limit) {
  return (2 * Math.random() - 1) * limit;
}

function clipped(value, limit) {
  return Math.min(Math.max(value, -limit), limit);
}

/** Returns the observation: cos θ, sin θ, θ̇ in rad/s. */
function observed(theta, thetadot) {
  return Float32Array.of(Math.cos(theta), Math.sin(theta), thetadot);
}

/** Returns θ, θ̇ and the reward of one time step of 0.05 s. */
function advanced(gravity, theta, thetadot, torque) {
  const cost = wrapped(theta) ** 2 + 0.1 * thetadot ** 2 + 0.001 * torque ** 2;
  const acceleration = ((3 * gravity) / 2) * Math.sin(theta) + 3 * torque;
  const speed = clipped(thetadot + acceleration * TIME_STEP, MAX_SPEED);
  return [theta + speed * TIME_STEP, speed, -cost];
}

/** Returns the sum of the rewards of a policy, which returns a torque for θ and θ̇. */
function simulatedReturn(gravity, theta, thetadot, steps, policy) {
  let [total, reward] = [0, 0];
  for (let step = 0; step < steps; step++) {
    [theta, thetadot, reward] = advanced(gravity, theta, thetadot, policy(theta, thetadot));
    total += reward;
  }
  return total;
}

/** A series of episodes, driven by the network or by the user. */
class Episode {
  constructor(network, gravity) {
    this.network = network;
    this.gravity = gravity; // m/s²
    this.youDrive = false;
    this.yourTorque = 0; // N·m, acts until the user chooses another
    this.reset();
  }

  /** Starts an episode, by default at random like Gymnasium; θ in rad, 0 upright; θ̇ in rad/s. */
  reset(theta = uniform(Math.PI), thetadot = uniform(1)) {
    this.theta = theta;
    this.thetadot = thetadot;
    this.torque = 0; // of the last step, N·m
    this.reward = 0; // of the last step
    this.return = 0;
    this.steps = 0;
    this.path = [[theta, thetadot]];
    this.drivers = new Set();
    this.#observe();
  }

  get over() {
    return this.steps >= EPISODE_STEPS;
  }

  /** Takes one time step of 0.05 s with the torque of the driver. */
  step() {
    const torque = this.youDrive ? this.yourTorque : this.network.torques[this.best];
    const next = advanced(this.gravity, this.theta, this.thetadot, torque);
    [this.theta, this.thetadot, this.reward] = next;
    this.torque = torque;
    this.return += this.reward;
    this.steps += 1;
    this.path.push([this.theta, this.thetadot]);
    this.drivers.add(this.youDrive ? "you" : "network");
    this.#observe();
  }

  #observe() {
    this.qValues = this.network.qValues(observed(this.theta, this.thetadot)).slice();
    this.best = argmax(this.qValues);
  }
}
