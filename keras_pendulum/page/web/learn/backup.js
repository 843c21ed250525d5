"use strict";

/** The backup of a state: for each effort, its successor, r + γ max Q(s′), Q(s, u) and exact Q*(s, u). */
class Backup {
  /**
   * @param {number[]} state
   * @param {Network} network of the run.
   * @param {object} settings of the run.
   * @param {?object} exact its method `qValues` returns the exact ones.
   */
  constructor(state, network, settings, exact) {
    const { task, efforts } = network;
    const scale = settings.reward_scale;
    const bootstrap = BOOTSTRAPS[settings.bootstrap];
    Object.assign(this, { state, efforts });
    this.qValues = Array.from(network.qValues(task.observed(state)), (value) => value / scale);
    this.best = argmax(this.qValues);
    this.steps = efforts.map((effort) => task.advanced(state, effort));
    this.targets = this.steps.map(({ state: next, reward, over }) => {
      const values = network.qValues(task.observed(next));
      const future = over ? 0 : bootstrap(values, values, 0, values.length) / scale;
      return settings.reward_factor * reward + settings.discount * future;
    });
    this.exact = exact && exact.qValues(state, efforts);
  }

  /** Returns the backup of the greedy effort in words. */
  text(task) {
    const { state, efforts, best, steps, targets, qValues, exact } = this;
    const [theta, thetadot] = state.slice(-2);
    const parts = [
      `θ = ${shown(theta, 2)} rad, θ̇ = ${shown(thetadot, 2)} rad/s, greedy ${task.bestText(efforts[best], efforts)}`,
      `r = ${shown(steps[best].reward, 2)}, target ${shown(targets[best], 2)}`,
      `Q = ${shown(qValues[best], 2)}, TD error ${shown(targets[best] - qValues[best], 2, true)}`,
    ];
    if (exact) parts.push(`exact Q* = ${shown(exact[best], 2)}`);
    return `${parts.join("; ")}.`;
  }
}

/** Draws arcs from the state to the successor of each effort, enlarged. */
function drawFan(canvas, colours, task, { state, steps, efforts, best }) {
  const { context, width, height } = blank(canvas);
  const [here, ...next] = [state, ...steps.map((step) => step.state)].map((each) => each.slice(-2));
  const moves = next.map(([theta, thetadot]) => [theta - here[0], thetadot - here[1]]);
  const reach = [0, 1].map((i) => Math.max(1e-6, ...moves.map((move) => Math.abs(move[i]))));
  const [middle, level] = [width / 2, height / 2];
  const place = ([angle, speed]) => [
    middle + ((task.rightward * angle) / reach[0]) * (width / 2 - 30),
    level - (speed / reach[1]) * (height / 2 - 26),
  ];
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[8, level], [width - 8, level]]);
  line(context, [[middle, 8], [middle, height - 8]]);
  const order = [...moves.keys()].filter((i) => i !== best);
  for (const i of [...order, best]) {
    const [x, y] = place(moves[i]);
    context.strokeStyle = i === best ? colours.ink : `rgb(${colours.ofEffort(efforts[i])})`;
    context.lineWidth = i === best ? 3 : 1.5;
    context.beginPath();
    context.moveTo(middle, level);
    context.quadraticCurveTo(x, level, x, y); // first the old velocity, then the new one
    context.stroke();
    context.fillStyle = context.strokeStyle;
    dot(context, x, y, i === best ? 5 : 3);
  }
  context.fillStyle = colours.path;
  dot(context, middle, level, 5);
  context.fillStyle = colours.soft;
  context.font = "12px system-ui, sans-serif";
  write(context, `Δθ ±${reach[0].toFixed(2)} rad`, width - 8, height - 8, "right");
  write(context, `Δθ̇ ±${reach[1].toFixed(2)} rad/s`, 8, 10, "left");
}

/** Draws, over the efforts: the network's Q, the targets r + γ max Q(s′), and exact Q*. */
function drawBackup(canvas, colours, task, { efforts, qValues, targets, exact, best }) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [52, width - 10, 12, height - 36];
  const all = [...qValues, ...targets, ...(exact ?? [])];
  const [lowest, highest] = [Math.min(...all), Math.max(...all)];
  const x = (effort) => left + ((effort + task.maxEffort) / (2 * task.maxEffort)) * (right - left);
  const y = (value) => bottom - ((value - lowest) / (highest - lowest || 1)) * (bottom - top);
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = colours.soft;
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[left, top], [left, bottom], [right, bottom]]);
  for (const value of [lowest, highest]) write(context, shown(value, 1), left - 6, y(value), "right");
  for (const [effort, label] of task.effortTicks) {
    const side = { [-task.maxEffort]: "left", [task.maxEffort]: "right" }[effort];
    write(context, label, x(effort), bottom + 12, side);
  }
  write(context, task.effortAxis, (left + right) / 2, bottom + 27);
  line(context, [[x(efforts[best]), top], [x(efforts[best]), bottom]]);
  const curve = (values) => values.map((value, i) => [x(efforts[i]), y(value)]);
  context.lineWidth = 2;
  if (exact) {
    context.strokeStyle = colours.plus;
    context.setLineDash([6, 4]);
    line(context, curve(exact));
    context.setLineDash([]);
  }
  context.strokeStyle = colours.ink;
  line(context, curve(qValues));
  context.fillStyle = colours.accent;
  for (const point of curve(targets)) dot(context, ...point, 3);
}
