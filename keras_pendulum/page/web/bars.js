"use strict";

/**
 * Returns a round lower end of the axis of the Q-values below the best one, of which `lowest` is the
 * lowest. The end `before` stays as long as the values fill a tenth of the axis: a policy that balances
 * may alternate between states with small and large differences, and the axis must not follow.
 */
function steadyFloor(lowest, before) {
  const span = Math.max(-lowest, 1e-3);
  if (before && span <= -before && 10 * span >= -before) return before;
  const power = 10 ** Math.floor(Math.log10(span));
  return -power * [1, 2, 5, 10].find((factor) => factor * power >= span * 0.999999);
}

/** Draws a bar for the Q-value of each effort, from `floor` below the best up, and marks `taken`. */
function drawBars(canvas, colours, task, efforts, qValues, floor, best, taken) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [76, width - 6, 12, height - 38];
  const pitch = (right - left) / efforts.length;
  const middle = (i) => left + (i + 0.5) * pitch;
  const lowest = bottom - 4; // y of the floor; the lowest bar stays visible

  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[left, top], [right, top]]);
  line(context, [[left, bottom], [right, bottom]]);
  context.fillStyle = colours.soft;
  const digits = Math.max(-Math.floor(Math.log10(-floor)), 0);
  for (const [value, y] of [[0, top], [floor, lowest]]) {
    write(context, shown(value, value && digits), left - 6, y, "right");
  }
  context.save();
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "Q − best Q", 0, 0);
  context.restore();

  qValues.forEach((value, i) => {
    const y = top + ((value - qValues[best]) / floor) * (lowest - top);
    const [x, wide] = [middle(i) - pitch * 0.41, pitch * 0.82];
    context.fillStyle = i === best ? colours.ink : `rgb(${colours.ofEffort(efforts[i])})`;
    context.fillRect(x, y, wide, bottom - y);
    if (i !== best) {
      context.strokeStyle = colours.soft;
      context.lineWidth = 0.5;
      context.strokeRect(x, y, wide, bottom - y);
    }
  });

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
    context.beginPath();
    context.moveTo(x, bottom + 1);
    context.lineTo(x - 5, bottom + 8);
    context.lineTo(x + 5, bottom + 8);
    context.fill();
  }
}
