"use strict";

const [CART_WIDTH, CART_HEIGHT] = [0.5, 0.3]; // m

/**
 * Draws cart and pole as Gymnasium does, to scale: a rail with a post at both ends, and the pole's
 * limits. `states` are the last ones; the present one is the last.
 */
function drawSystem(canvas, colours, states, push, task) {
  const { context, width, height } = blank(canvas);
  const { middle, rail, meter } = task.track([width, height]);
  const axle = rail - CART_AXLE * meter;
  const at = (x) => middle + x * meter;
  const tip = (x, theta, length) => [
    at(x) + Math.sin(theta) * length * meter,
    axle - Math.cos(theta) * length * meter,
  ];

  context.strokeStyle = colours.line;
  context.lineWidth = 2;
  line(context, [[at(-LARGEST_POSITION), rail], [at(LARGEST_POSITION), rail]]);
  context.fillStyle = colours.soft;
  for (const end of [-LARGEST_POSITION, 0, LARGEST_POSITION]) {
    line(context, [[at(end), rail - (end ? 0.35 * meter : 0)], [at(end), rail + 0.1 * meter]]);
    const inside = Math.min(Math.max(at(end), 20), width - 24);
    write(context, end ? `${shown(end, 1)} m` : "0", inside, rail + 0.1 * meter + 10);
  }

  const [x, , theta] = states.at(-1);
  context.setLineDash([4, 5]);
  context.lineWidth = 1.5;
  for (const limit of [-LARGEST_ANGLE, LARGEST_ANGLE]) {
    line(context, [[at(x), axle], tip(x, limit, 1.15)]);
  }
  context.setLineDash([]);

  context.strokeStyle = colours.rod;
  context.lineWidth = 2;
  states.slice(1).forEach((state, i) => {
    context.globalAlpha = (0.35 * (i + 1)) / states.length;
    line(context, [states[i], state].map(([before, , angle]) => tip(before, angle, 1)));
  });
  context.globalAlpha = 1;

  context.fillStyle = colours.soft;
  context.beginPath();
  const corner = [at(x - CART_WIDTH / 2), axle - (CART_HEIGHT / 2) * meter];
  context.roundRect(...corner, CART_WIDTH * meter, CART_HEIGHT * meter, 0.05 * meter);
  context.fill();
  context.lineWidth = 0.1 * meter;
  line(context, [[at(x), axle], tip(x, theta, 1)]);
  context.fillStyle = colours.card;
  dot(context, at(x), axle, 0.025 * meter);
  if (push) drawPush(context, colours, [at(x), axle], meter, push);
}

/** Draws the push as an arrow that ends at the side of the cart on which it acts. */
function drawPush(context, colours, [x, y], meter, push) {
  const direction = Math.sign(push);
  const tip = x - direction * (CART_WIDTH / 2 + 0.04) * meter;
  const head = tip - direction * 0.18 * meter;
  context.strokeStyle = context.fillStyle = push < 0 ? colours.minus : colours.plus;
  context.lineWidth = 0.09 * meter;
  context.lineCap = "butt";
  line(context, [[tip - direction * 0.5 * meter, y], [head, y]]);
  polygon(context, [[tip, y], [head, y - 0.13 * meter], [head, y + 0.13 * meter]]);
}
