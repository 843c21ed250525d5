"use strict";

// The value of a next state from the Q-values [rows, A] that start at `from`; `chosen` are those that
// choose its action. `mean` and `none` are faults.
const BOOTSTRAPS = {
  maximum: (values, chosen, from, actions) => values[argmax(chosen, from, from + actions)],
  mean: (values, chosen, from, actions) => {
    let sum = 0;
    for (let i = from; i < from + actions; i++) sum += values[i];
    return sum / actions;
  },
  none: () => 0,
};

// The loss of an error, and its derivative. `share` is that of one transition in the mean.
const LOSSES = {
  squared: {
    share: (rows, actions) => 1 / (rows * actions), // a mean over all outputs
    value: (error) => error * error,
    slope: (error) => 2 * error,
  },
  huber: {
    share: (rows) => 1 / rows,
    value: (error) => (Math.abs(error) < 1 ? 0.5 * error * error : Math.abs(error) - 0.5),
    slope: (error) => Math.min(Math.max(error, -1), 1),
  },
};

/** The DQN update of Mnih et al. 2015, as dqn/agent.py makes it. */
class Learner {
  /**
   * @param {LearningNetwork} online the network that acts and learns.
   * @param {object} settings by the names of the Config, and `bootstrap`, see BOOTSTRAPS.
   */
  constructor(online, settings) {
    Object.assign(this, { online, settings });
    this.target = online;
    if (settings.target_update !== "none") {
      this.target = new LearningNetwork(online.sizes, settings.activation);
      this.target.weights.set(online.weights);
    }
    this.optimizer = new Optimizer(settings, online.weights.length);
    const rows = settings.batch_size;
    this.targets = new Float64Array(rows);
    this.values = new Float64Array(rows); // of the actions taken
    this.slopes = new Float64Array(rows); // of the loss by these
  }

  /** Makes one gradient step from a batch; returns its loss. */
  update(batch) {
    const { online, targets, values, slopes } = this;
    const { batch_size: rows, loss } = this.settings;
    const { share, value, slope } = LOSSES[loss];
    const part = share(rows, online.sizes.at(-1));
    this.#setTargets(batch, rows);
    online.takenValues(batch.observations, batch.actions, rows, values);
    let total = 0;
    for (let row = 0; row < rows; row++) {
      const error = values[row] - targets[row];
      total += part * value(error);
      slopes[row] = part * slope(error);
    }
    online.backward(batch.observations, batch.actions, rows, slopes);
    this.optimizer.apply(online.weights, online.gradients);
    this.#updateTarget();
    return total;
  }

  /** Writes the TD targets: r + γ·max Q(next), and r after termination. */
  #setTargets({ rewards, nextObservations, ended }, rows) {
    const { online, target, targets, settings } = this;
    const bootstrap = BOOTSTRAPS[settings.bootstrap];
    const next = target.qValues(nextObservations, rows);
    // The online network chooses the next action with double Q (van Hasselt et al. 2016).
    const chosen = settings.double_q ? online.qValues(nextObservations, rows) : next;
    const actions = online.sizes.at(-1);
    for (let row = 0; row < rows; row++) {
      const future = ended[row] ? 0 : bootstrap(next, chosen, row * actions, actions);
      targets[row] = rewards[row] + settings.discount * future;
    }
  }

  #updateTarget() {
    const { target_update: rule, tau, target_period: period } = this.settings;
    const [source, destination] = [this.online.weights, this.target.weights];
    if (rule === "soft") {
      for (let i = 0; i < source.length; i++) destination[i] += tau * (source[i] - destination[i]);
    } else if (rule === "hard" && this.optimizer.updates % period === 0) destination.set(source);
  }
}
