"use strict";

/**
 * Returns a round end of the axis of the Q-values, for the number that is farthest from 0. The end
 * `before` stays as long as the values fill a fifth of the axis, so that bars can be compared.
 */
function steadyEnd(farthest, before) {
  const size = Math.max(Math.abs(farthest), 1); // small values stay small
  const isNegative = farthest < 0;
  if (before && isNegative === before < 0 && size <= Math.abs(before) && 5 * size >= Math.abs(before)) {
    return before;
  }
  const power = 10 ** Math.floor(Math.log10(size));
  const round = power * [1, 2, 5, 10].find((factor) => factor * power >= size * 0.999999);
  return isNegative ? -round : round;
}

/** Draws a bar from 0 for the Q-value of each effort, dashes at the exact ones, and marks `taken`. */
function drawBars(canvas, colours, task, { efforts, values, exact, best, end, taken }) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [76, width - 6, 12, height - 38];
  const pitch = (right - left) / efforts.length;
  const middle = (i) => left + (i + 0.5) * pitch;
  // Values of the other sign than the end need a part of the axis, too.
  const all = [...values, ...(exact ?? []), 0, end];
  const [lowest, highest] = [Math.min(...all), Math.max(...all)];
  const y = (value) => bottom - ((value - lowest) / (highest - lowest)) * (bottom - top);

  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  for (const value of [0, end]) line(context, [[left, y(value)], [right, y(value)]]);
  context.fillStyle = colours.soft;
  const digits = Math.max(-Math.floor(Math.log10(Math.abs(end))), 0);
  for (const value of [0, end]) write(context, shown(value, value && digits), left - 6, y(value), "right");
  context.save();
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "Q-value", 0, 0);
  context.restore();

  values.forEach((value, i) => {
    const [x, wide] = [middle(i) - pitch * 0.41, pitch * 0.82];
    context.fillStyle = i === best ? colours.ink : `rgb(${colours.ofEffort(efforts[i])})`;
    context.fillRect(x, y(0), wide, y(value) - y(0));
    if (i !== best) {
      context.strokeStyle = colours.soft;
      context.lineWidth = 0.5;
      context.strokeRect(x, y(0), wide, y(value) - y(0));
    }
  });
  for (const [colour, wide] of exact ? [[colours.halo, 5], [colours.path, 2]] : []) {
    context.strokeStyle = colour;
    context.lineWidth = wide;
    exact.forEach((value, i) => {
      line(context, [[middle(i) - pitch * 0.3, y(value)], [middle(i) + pitch * 0.3, y(value)]]);
    });
  }

  context.fillStyle = colours.soft;
  const place = (effort) =>
    middle(((effort + task.maxEffort) / (2 * task.maxEffort)) * (efforts.length - 1));
  for (const [effort, label] of task.effortTicks) {
    write(context, label, place(effort), bottom + 15);
  }
  write(context, task.effortAxis, (left + right) / 2, bottom + 31);
  if (taken !== null) {
    context.fillStyle = colours.accent;
    const x = place(taken);
    polygon(context, [[x, bottom + 1], [x - 5, bottom + 8], [x + 5, bottom + 8]]);
  }
}
