// The run: reads the data of replay.py and interpolates it at any time.

const PER_UNIT = 10000;
const PER_ERROR = 1000000;

function readRun(data) {
  const traces = data.traces.map(readTrace);
  return {
    ...data,
    traces,
    start: Math.min(...traces.map((trace) => trace.times[0])),
    end: Math.max(...traces.map((trace) => trace.times[trace.times.length - 1])),
  };
}

function readTrace(trace) {
  const small = (value) => (value === null ? null : value / PER_ERROR);
  const overModules = (goals) =>
    Object.entries(goals).map(([module, points]) => ({ module: +module, points: points.map(point) }));
  return {
    ...trace,
    frames: trace.frames.map(readFrames),
    desired: overModules(trace.desired),
    axes: overModules(trace.axes),
    tube: trace.tube.map((row) => row && readBall(row)),
    horizon: trace.horizon.map((tips) => tips.map(point)),
    obstacles: trace.obstacles.map((step) =>
      step
        .map((row, k) => isPresent(row) && { ...readBall(row), surface: trace.solids[k].map(point) })
        .filter(Boolean),
    ),
    errors: trace.errors.map(small),
    axisErrors: trace.axisErrors.map(small),
  };
}

const point = (p) => (p === null ? null : scaled(p, 1 / PER_UNIT));
const readBall = (row) => ({ center: point(row.slice(0, 3)), radius: row[3] / PER_UNIT });
const isPresent = (obstacle) => obstacle.every((value) => value !== null) && obstacle[3] > 0;

const BASE = { position: [0, 0, 0], x: [1, 0, 0], z: [0, 0, 1] };
const frameOf = (position, x, z) => ({ position, x: unit(x), z: unit(z) });

// Frames of the base and of every module end at one step, or null if any is unknown.
function readFrames(row) {
  if (row === null) return null;
  const frames = [BASE];
  for (let k = 0; k < row.length; k += 9)
    frames.push(frameOf(point(row.slice(k, k + 3)), row.slice(k + 3, k + 6), row.slice(k + 6, k + 9)));
  return frames;
}

// The step before `time` and the share of the way to the next one.
function stepAt(times, time) {
  let low = 0,
    high = times.length - 1;
  if (time >= times[high]) return { step: high, share: 0 };
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return { step: low, share: clamp((time - times[low]) / (times[high] - times[low]), 0, 1) };
}

// A value between two steps; that of the nearer step if one is unknown.
function valueAt(values, { step, share }, mix) {
  const here = values[step],
    next = values[Math.min(step + 1, values.length - 1)];
  if (here === null || next === null) return share < 0.5 ? here : next;
  return mix(here, next, share);
}

const mixNumbers = (a, b, share) => a + (b - a) * share;
const mixFrames = (a, b, share) =>
  a.map((frame, k) => frameOf(...["position", "x", "z"].map((name) => between(frame[name], b[k][name], share))));
const mixObstacles = (a, b, share) =>
  a.length !== b.length
    ? a
    : a.map((obstacle, k) => ({
        center: between(obstacle.center, b[k].center, share),
        radius: mixNumbers(obstacle.radius, b[k].radius, share),
        surface: obstacle.surface,
      }));

// Frames, goals, obstacles and errors of one trace at one time.
function momentOf(trace, time) {
  const place = stepAt(trace.times, time);
  const points = (goals) =>
    goals
      .map(({ module, points }) => ({ module, point: valueAt(points, place, between) }))
      .filter(({ point }) => point);
  return {
    place,
    frames: valueAt(trace.frames, place, mixFrames),
    desired: points(trace.desired),
    axes: points(trace.axes).map(({ module, point }) => ({ module, axis: unit(point) })),
    obstacles: trace.obstacles.length > 1 ? valueAt(trace.obstacles, place, mixObstacles) : trace.obstacles[0],
    error: valueAt(trace.errors, place, mixNumbers),
    axisError: valueAt(trace.axisErrors, place, mixNumbers),
    plan: trace.plans.filter(([step]) => step <= place.step).pop()?.[1] ?? "",
  };
}
