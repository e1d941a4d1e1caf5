// Vectors of three numbers.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
const along = (start, direction, k) => [
  start[0] + direction[0] * k,
  start[1] + direction[1] * k,
  start[2] + direction[2] * k,
];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => scaled(a, 1 / (length(a) || 1));
const between = (a, b, share) => [0, 1, 2].map((k) => a[k] + (b[k] - a[k]) * share);
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

// The part of `a` that is square to the unit vector `axis`, as a unit vector.
const squareTo = (a, axis) => unit(along(a, axis, -dot(a, axis)));

// A function that turns base-frame vectors so that gravity points down the screen.
function uprightTurn(gravity) {
  if (length(gravity) === 0 || gravity[2] < -0.9999) return (v) => v;
  if (gravity[2] > 0.9999) return (v) => [v[0], -v[1], -v[2]];
  const up = unit(scaled(gravity, -1));
  const axis = cross(up, [0, 0, 1]);
  return (v) => add(add(scaled(v, up[2]), cross(axis, v)), scaled(axis, dot(axis, v) / (1 + up[2])));
}

// The round number (1, 2 or 5 times a power of ten) nearest above `value`.
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((step) => step * power >= value * 0.999);
}
