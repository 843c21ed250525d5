"use strict";

/**
 * Returns round limits of an axis for `values`. The limits `before` stay as long as the values are
 * within them and fill a fifth of them, so that the axis does not move with every step.
 */
function steadyLimits(values, before) {
  const [lowest, highest] = [Math.min(...values), Math.max(...values)];
  const span = Math.max(highest - lowest, 1e-3);
  if (before && lowest >= before[0] && highest <= before[1] && 5 * span >= before[1] - before[0]) {
    return before;
  }
  const power = 10 ** Math.floor(Math.log10(span / 2));
  const unit = power * [5, 2, 1].find((factor) => factor * power <= span / 2);
  const low = Math.floor(lowest / unit) * unit;
  return [low, Math.max(Math.ceil(highest / unit) * unit, low + unit)];
}

/** Draws a bar for the Q-value of each torque between the `limits`, and marks `taken`. */
function drawBars(canvas, colours, torques, qValues, limits, best, taken) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [76, width - 6, 12, height - 38];
  const [lowest, highest] = limits;
  const pitch = (right - left) / torques.length;
  const middle = (i) => left + (i + 0.5) * pitch;
  const floor = bottom - 4; // the lowest bar stays visible

  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[left, top], [right, top]]);
  line(context, [[left, bottom], [right, bottom]]);
  context.fillStyle = colours.soft;
  const digits = clipped(Math.max(1 - Math.floor(Math.log10(highest - lowest)), 0), 4);
  for (const [value, y] of [[highest, top], [lowest, floor]]) {
    write(context, shown(value, digits), left - 6, y, "right");
  }
  context.save();
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "Q (return)", 0, 0);
  context.restore();

  qValues.forEach((value, i) => {
    const share = (value - lowest) / (highest - lowest);
    const y = floor - share * (floor - top);
    const [x, wide] = [middle(i) - pitch * 0.41, pitch * 0.82];
    context.fillStyle = i === best ? colours.ink : `rgb(${colours.ofTorque(torques[i])})`;
    context.fillRect(x, y, wide, bottom - y);
    if (i !== best) {
      context.strokeStyle = colours.soft;
      context.lineWidth = 0.5;
      context.strokeRect(x, y, wide, bottom - y);
    }
  });

  context.fillStyle = colours.soft;
  const place = (torque) =>
    middle(((torque + MAX_TORQUE) / (2 * MAX_TORQUE)) * (torques.length - 1));
  for (const torque of [-2, -1, 0, 1, 2]) {
    write(context, shown(torque, 0, torque !== 0), place(torque), bottom + 15);
  }
  write(context, "torque (N·m)", (left + right) / 2, bottom + 31);
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
