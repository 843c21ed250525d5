"use strict";

/**
 * Draws the pendulum as Gymnasium does: upright at θ = 0, positive angles and torques
 * counter-clockwise. `states` are the last ones; the present one is the last.
 */
function drawSystem(canvas, colours, states, torque, task) {
  const trail = states.map(([theta]) => theta);
  const theta = trail.at(-1);
  const { context, width, height } = blank(canvas);
  const rod = Math.min(width / 2 - 14, height / 2 - 28);
  const labelled = width / 2 - rod >= 52; // the sides have labels where they make it no smaller
  context.translate(width / 2, height / 2);
  const at = (angle, radius) => [-Math.sin(angle) * radius, -Math.cos(angle) * radius];

  context.strokeStyle = colours.line;
  context.lineWidth = 1.5;
  context.beginPath();
  context.arc(0, 0, rod + 8, 0, 2 * Math.PI);
  context.stroke();
  for (let i = 0; i < 12; i++) {
    const angle = (i * Math.PI) / 6;
    line(context, [at(angle, rod + 8), at(angle, rod + (i % 3 ? 4 : 0))]);
  }
  context.fillStyle = colours.soft;
  write(context, "0", 0, -rod - 18);
  write(context, "±π", 0, rod + 20);
  if (labelled) {
    write(context, "π/2", -rod - 18, 0, "right");
    write(context, "−π/2", rod + 18, 0, "left");
  }

  context.strokeStyle = colours.rod;
  context.lineWidth = rod * 0.05;
  context.lineCap = "butt";
  trail.slice(1).forEach((angle, i) => {
    context.globalAlpha = (0.35 * (i + 1)) / trail.length;
    context.beginPath();
    const [from, to] = [-trail[i] - Math.PI / 2, -angle - Math.PI / 2];
    context.arc(0, 0, rod, Math.min(from, to), Math.max(from, to));
    context.stroke();
  });
  context.globalAlpha = 1;
  context.lineCap = "round";

  context.lineWidth = rod * 0.13;
  line(context, [[0, 0], at(theta, rod * 0.935)]);
  context.fillStyle = colours.card;
  dot(context, 0, 0, rod * 0.03);
  drawTorque(context, colours, rod, torque, task);
}

/** Draws a curved arrow below the pivot; its length is proportional to the torque. */
function drawTorque(context, colours, rod, torque, task) {
  if (Math.abs(torque) < 0.01) return;
  const radius = rod * 0.42;
  const sign = -Math.sign(torque); // a canvas counts angles clockwise
  const share = Math.abs(torque) / task.maxEffort;
  const span = share * (2 / 3) * Math.PI;
  const [start, end] = [Math.PI / 2 - (sign * span) / 2, Math.PI / 2 + (sign * span) / 2];
  const colour = torque < 0 ? colours.minus : colours.plus;
  const head = rod * (0.06 + 0.04 * share);
  const tip = end + (sign * head * 1.5) / radius;
  const point = (angle, distance) => [Math.cos(angle) * distance, Math.sin(angle) * distance];
  for (const [style, extra] of [[colours.card, rod * 0.035], [colour, 0]]) {
    context.strokeStyle = context.fillStyle = style;
    context.lineWidth = rod * 0.055 + extra;
    context.lineCap = "butt";
    context.beginPath();
    context.arc(0, 0, radius, start, end, sign < 0);
    context.stroke();
    polygon(context, [point(tip, radius), point(end, radius + head), point(end, radius - head)]);
  }
}
