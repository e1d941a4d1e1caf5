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

// The round number (1, 2 or 5 times a power of ten) nearest above `value`.
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((step) => step * power >= value * 0.999);
}
