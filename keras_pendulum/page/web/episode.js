"use strict";

function uniform(limit) {
  return (2 * Math.random() - 1) * limit;
}

function clipped(value, limit) {
  return Math.min(Math.max(value, -limit), limit);
}

function clippedShare(share) {
  return Math.min(Math.max(share, 0), 1);
}

/** Returns the return of a policy, which returns an effort for a state. */
function simulatedReturn(task, state, steps, policy) {
  let total = 0;
  for (let step = 0; step < steps; step++) {
    const next = task.advanced(state, policy(state));
    total += next.reward;
    if (next.over) break;
    state = next.state;
  }
  return total;
}

/**
 * A series of episodes, driven by the network or by the user.
 *
 * A state is an array of numbers, of which the last two are θ in rad, 0 upright, and θ̇ in rad/s. An
 * effort is a torque in N·m or a force in N.
 */
class Episode {
  constructor(network, task) {
    this.network = network;
    this.task = task;
    this.youDrive = false;
    this.yourEffort = 0; // acts until the user chooses another
    this.reset();
  }

  /** Starts an episode in a state, by default at random like Gymnasium. */
  reset(...state) {
    this.state = state.length ? state : this.task.randomStart();
    this.effort = 0; // of the last step
    this.reward = 0; // of the last step
    this.return = 0;
    this.steps = 0;
    this.over = false;
    this.path = [this.state];
    this.drivers = new Set();
    this.#observe();
  }

  /** Takes one time step with the effort of the driver. */
  step() {
    const { task, youDrive } = this;
    const chosen = youDrive ? this.yourEffort : this.network.efforts[this.best];
    this.effort = task.acting(chosen, this.steps);
    const next = task.advanced(this.state, this.effort);
    [this.state, this.reward] = [next.state, next.reward];
    this.return += this.reward;
    this.steps += 1;
    this.over = next.over || this.steps >= task.episodeSteps;
    this.path.push(this.state);
    this.drivers.add(youDrive ? "you" : "network");
    this.#observe();
  }

  #observe() {
    this.qValues = this.network.qValues(this.task.observed(this.state)).slice();
    this.best = argmax(this.qValues);
  }
}
