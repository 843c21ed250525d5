"use strict";

// Each function writes into its argument; each slope is that of a value that the function has returned.
const LEARNED_ACTIVATIONS = {
  tanh: {
    apply: (values, end) => {
      for (let i = 0; i < end; i++) values[i] = 1 - 2 / (Math.exp(2 * values[i]) + 1);
    },
    slope: (value) => 1 - value * value,
  },
  relu: {
    apply: (values, end) => {
      for (let i = 0; i < end; i++) if (!(values[i] > 0)) values[i] = 0;
    },
    slope: (value) => (value > 0 ? 1 : 0),
  },
};

/**
 * A Q-network that can learn: dense layers with an activation, then a linear output for each action.
 *
 * `weights` holds the kernel [in, out] and the bias [out] of each layer in order, `gradients` what
 * belongs to them. Both are one array, so that the optimizer is one loop.
 */
class DenseNetwork {
  /**
   * @param {number[]} sizes of all layers, the observation's first.
   * @param {string} activation of the hidden layers.
   */
  constructor(sizes, activation) {
    this.sizes = sizes;
    this.activation = LEARNED_ACTIVATIONS[activation];
    const count = sizes.slice(1).reduce((sum, units, i) => sum + (sizes[i] + 1) * units, 0);
    this.weights = new Float64Array(count);
    this.gradients = new Float64Array(count);
    let start = 0;
    this.layers = sizes.slice(1).map((units, i) => {
      const [inputs, kernel] = [sizes[i], start];
      const bias = kernel + inputs * units;
      start = bias + units;
      const parts = (all) => [all.subarray(kernel, bias), all.subarray(bias, start)];
      const [[kernels, biases], [kernelGradients, biasGradients]] = [this.weights, this.gradients].map(parts);
      const turned = new Float64Array(inputs * units);
      return { inputs, units, kernels, biases, kernelGradients, biasGradients, turned };
    });
    this.#reserve(1);
  }

  /** Draws the initial weights as the setting `initial_weights` says, see dqn/network.py. */
  initialize(rule, random) {
    this.layers.forEach(({ inputs, units, kernels, biases }, i) => {
      const isHead = i === this.layers.length - 1;
      const fanIn = inputs ** -0.5;
      const spread = rule === "spread" && !isHead;
      const limit = rule === "fan-in" || (spread && i === 0) ? fanIn : Math.sqrt(6 / (inputs + units));
      const biasLimit = rule === "fan-in" ? fanIn : spread ? 0.3 : 0;
      for (let k = 0; k < kernels.length; k++) kernels[k] = random.within(limit);
      for (let k = 0; k < units; k++) biases[k] = random.within(biasLimit);
    });
  }

  /** Returns the Q-values [rows, A] of observations [rows, D]; the next call overwrites the array. */
  qValues(observations, rows) {
    const { kernels, biases, inputs, units } = this.layers.at(-1);
    const features = this.#hidden(observations, rows);
    const output = this.outputs.at(-1);
    for (let row = 0; row < rows; row++) output.set(biases, row * units);
    addProduct(output, features, inputs, 1, kernels, rows, inputs, units);
    return output;
  }

  /** Writes the Q-values [rows] of the actions [rows] that were taken in observations [rows, D]. */
  takenValues(observations, actions, rows, values) {
    const { kernels, biases, inputs, units } = this.layers.at(-1);
    const features = this.#hidden(observations, rows);
    for (let row = 0; row < rows; row++) {
      const action = actions[row];
      let sum = biases[action];
      for (let i = 0; i < inputs; i++) sum += features[row * inputs + i] * kernels[i * units + action];
      values[row] = sum;
    }
  }

  /**
   * Writes the gradients of a loss, after `takenValues` of the same observations. `slopes` [rows] are
   * its derivatives by the values of the actions taken; those by all other outputs are 0.
   */
  backward(observations, actions, rows, slopes) {
    this.gradients.fill(0);
    const head = this.layers.length - 1;
    this.#backwardHead(head ? this.outputs[head - 1] : observations, actions, rows, slopes);
    for (let i = head - 1; i >= 0; i--) {
      const { inputs, units, kernels, kernelGradients, biasGradients, turned } = this.layers[i];
      const [output, deltas] = [this.outputs[i], this.deltas[i]];
      const { slope } = this.activation;
      for (let row = 0, k = 0; row < rows; row++) {
        for (let unit = 0; unit < units; unit++, k++) {
          deltas[k] *= slope(output[k]);
          biasGradients[unit] += deltas[k];
        }
      }
      const features = i ? this.outputs[i - 1] : observations;
      addProduct(kernelGradients, features, 1, inputs, deltas, inputs, rows, units);
      if (!i) break;
      transpose(turned, kernels, inputs, units);
      this.deltas[i - 1].fill(0, 0, rows * inputs);
      addProduct(this.deltas[i - 1], deltas, units, 1, turned, rows, units, inputs);
    }
  }

  #backwardHead(features, actions, rows, slopes) {
    const head = this.layers.length - 1;
    const { inputs, units, kernels, kernelGradients, biasGradients } = this.layers[head];
    const deltas = this.deltas[head - 1];
    for (let row = 0; row < rows; row++) {
      const [action, slope] = [actions[row], slopes[row]];
      biasGradients[action] += slope;
      for (let i = 0; i < inputs; i++) {
        const [here, weight] = [row * inputs + i, i * units + action];
        kernelGradients[weight] += slope * features[here];
        if (deltas) deltas[here] = slope * kernels[weight];
      }
    }
  }

  /** Returns the outputs [rows, units] of the last hidden layer. */
  #hidden(observations, rows) {
    if (rows > this.rows) this.#reserve(rows);
    let features = observations;
    for (let i = 0; i < this.layers.length - 1; i++) {
      const { kernels, biases, inputs, units } = this.layers[i];
      const output = this.outputs[i];
      for (let row = 0; row < rows; row++) output.set(biases, row * units);
      addProduct(output, features, inputs, 1, kernels, rows, inputs, units);
      this.activation.apply(output, rows * units);
      features = output;
    }
    return features;
  }

  #reserve(rows) {
    this.rows = rows;
    this.outputs = this.layers.map(({ units }) => new Float64Array(rows * units));
    this.deltas = this.layers.map(({ units }) => new Float64Array(rows * units));
  }
}
