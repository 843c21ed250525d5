"use strict";

const GRAVITY = 9.8; // m/s²
const [POLE_MASS, TOTAL_MASS] = [0.1, 1.1]; // kg: of the pole, and of cart and pole
const HALF_LENGTH = 0.5; // m, of the pole
const LARGEST_POSITION = 2.4; // m
const LARGEST_ANGLE = (12 * Math.PI) / 180;
const CART_AXLE = 0.16; // m above the rail in the drawing

/**
 * Gymnasium's CartPole-v1 with the same operations in the same order. A state is x in m, ẋ in m/s,
 * θ in rad and θ̇ in rad/s; x, θ and the push are positive to the right.
 */
class Task {
  timeStep = 0.02; // s
  drivenStep = 0.05; // s on the clock when you drive: a hand is too slow for the real time
  episodeSteps = 500;
  maxEffort = 10; // N
  rightward = 1; // the sign of θ to the right, and of the effort that moves it there
  returnDigits = 0;
  curveName = "return";
  // The phase portrait.
  largest = [LARGEST_ANGLE, 3]; // θ in rad, θ̇ in rad/s
  angleTicks = [-0.2, -0.1, 0, 0.1, 0.2].map((angle) => [angle, shown(angle, angle && 1)]);
  speedTicks = [-3, 0, 3];
  mapSize = 49;
  aimed = [0.1, 0.3]; // m, m/s: as far x and ẋ may be from those of the map
  nudges = [0.02, 0.2]; // rad, rad/s, of a key
  fineNudges = [0.002, 0.02];
  effortTicks = [[-10, "left"], [10, "right"]];
  effortAxis = "push of 10 N";
  hanging = null; // the pole cannot hang
  limits = [LARGEST_POSITION, 3, LARGEST_ANGLE, 3]; // of a state that a pointer chooses
  readings = ["x", "xdot"]; // ids of the elements for the first numbers of the state

  /** Returns a state at random, like Gymnasium. */
  randomStart() {
    return [0, 0, 0, 0].map(() => uniform(0.05));
  }

  /** Returns θ. */
  angle(theta) {
    return theta;
  }

  /** Returns the observation: the state. */
  observed(state) {
    return Float32Array.from(state);
  }

  /** Returns the pushes in N of the outputs. */
  efforts() {
    return [-this.maxEffort, this.maxEffort];
  }

  effortText(push) {
    return shown(push, 0, true);
  }

  bestText(push) {
    return push < 0 ? "left" : "right";
  }

  /** Returns the push that acts. No step is without one: where you choose none, they alternate. */
  acting(push, step) {
    return push || (step % 2 ? this.maxEffort : -this.maxEffort);
  }

  /** Returns the state, the reward and whether the episode ends after one time step. */
  advanced([x, speed, theta, turn], push) {
    const [sine, cosine] = [Math.sin(theta), Math.cos(theta)];
    const thrust = (push + POLE_MASS * HALF_LENGTH * turn ** 2 * sine) / TOTAL_MASS;
    const angular =
      (GRAVITY * sine - cosine * thrust) /
      (HALF_LENGTH * (4 / 3 - (POLE_MASS * cosine ** 2) / TOTAL_MASS));
    const linear = thrust - (POLE_MASS * HALF_LENGTH * angular * cosine) / TOTAL_MASS;
    const { timeStep: tau } = this;
    const state = [x + tau * speed, speed + tau * linear, theta + tau * turn, turn + tau * angular];
    return { state, reward: 1, over: this.isOver(state) };
  }

  isOver([x, , theta]) {
    return Math.abs(x) > LARGEST_POSITION || Math.abs(theta) > LARGEST_ANGLE;
  }

  /** Returns where the track is in a canvas of this size in px: its middle, its height, and 1 m. */
  track([width, height]) {
    const meter = Math.min((0.92 * width) / (2 * LARGEST_POSITION), (0.8 * height) / 1.6);
    return { middle: width / 2, rail: height / 2 + 0.6 * meter, meter };
  }

  /** Returns which number of the state a pointer moves: x where it is at the cart, else θ. */
  grip(state, [, y], size) {
    const { rail, meter } = this.track(size);
    return y > rail - 0.4 * meter ? 0 : 2;
  }

  /** Returns x or θ where a pointer is. */
  gripped(state, grip, [x, y], size) {
    const { middle, rail, meter } = this.track(size);
    if (grip === 0) return clipped((x - middle) / meter, LARGEST_POSITION);
    const angle = Math.atan2(x - middle - state[0] * meter, rail - CART_AXLE * meter - y);
    return clipped(angle, LARGEST_ANGLE);
  }

  /** Returns the text on what a network is for. */
  about() {
    return "an output for each push, on CartPole-v1.";
  }
}
