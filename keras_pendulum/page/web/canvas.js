"use strict";

/** Returns the colours of the style sheet in the present theme, light or dark; efforts up to a largest one. */
function readColours(maxEffort) {
  const style = getComputedStyle(document.documentElement);
  const names = ["card", "ink", "soft", "line", "rod", "accent", "minus", "none", "plus", "path"];
  const colours = Object.fromEntries(
    [...names, "halo", "hatch"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]),
  );
  const { minus, none, plus } = colours;
  /** Returns red, green and blue of an effort. */
  colours.ofEffort = (effort) => mixed(none, effort < 0 ? minus : plus, Math.abs(effort) / maxEffort);
  return colours;
}

/** Returns red, green and blue between two colours #rrggbb. */
function mixed(from, to, share) {
  const channels = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const [first, second] = [channels(from), channels(to)];
  return first.map((channel, i) => Math.round(channel + share * (second[i] - channel)));
}

/** Clears a canvas at the resolution of the screen; returns its context and its size in CSS pixels. */
function blank(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const sharpness = window.devicePixelRatio || 1;
  const [columns, rows] = [Math.round(width * sharpness), Math.round(height * sharpness)];
  if (canvas.width !== columns || canvas.height !== rows) {
    canvas.width = columns;
    canvas.height = rows;
  }
  const context = canvas.getContext("2d");
  context.setTransform(sharpness, 0, 0, sharpness, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "13px system-ui, sans-serif";
  context.lineCap = context.lineJoin = "round";
  return { context, width, height };
}

function line(context, points) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function dot(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function polygon(context, corners) {
  context.beginPath();
  corners.forEach(([x, y]) => context.lineTo(x, y));
  context.fill();
}

function write(context, text, x, y, align = "center", baseline = "middle") {
  context.textAlign = align;
  context.textBaseline = baseline;
  context.fillText(text, x, y);
}

/** Formats a number with a typographic minus sign; `plus` adds the sign of positive numbers. */
function shown(value, digits, plus = false) {
  const text = value.toFixed(digits);
  const zero = Number(text) === 0;
  if (zero) return text.replace("-", "");
  return text.replace("-", "−").replace(/^(?=\d)/, plus ? "+" : "");
}
