// The run: reads what run_data.py wrote, and says where everything is at any time.

const PER_UNIT = 10000;
const PER_ERROR = 1000000;

function readRun(data) {
  const turn = uprightTurn(data.arm.gravity);
  const traces = data.traces.map((trace) => readTrace(trace, turn));
  return {
    ...data,
    traces,
    frame: { x: turn([1, 0, 0]), y: turn([0, 1, 0]), z: turn([0, 0, 1]) },
    stands: length(data.arm.gravity) === 0 || data.arm.gravity[2] < -0.7,
    hangs: data.arm.gravity[2] > 0.7,
    start: Math.min(...traces.map((trace) => trace.times[0])),
    end: Math.max(...traces.map((trace) => trace.times[trace.times.length - 1])),
  };
}

function readTrace(trace, turn) {
  const small = (value) => (value === null ? null : value / PER_ERROR);
  const point = (p) => (p === null ? null : turn(scaled(p, 1 / PER_UNIT)));
  const overModules = (asked) =>
    Object.entries(asked).map(([module, points]) => ({ module: +module, points: points.map(point) }));
  return {
    ...trace,
    states: trace.states.map((row) => readState(row, turn)),
    wanted: overModules(trace.wanted),
    axes: overModules(trace.axes),
    obstacles: trace.obstacles.map((step) =>
      step.filter(isThere).map((o) => ({ centre: point(o.slice(0, 3)), radius: o[3] / PER_UNIT })),
    ),
    errors: trace.errors.map(small),
    axisErrors: trace.axisErrors.map(small),
  };
}

const isThere = (obstacle) => obstacle.every((value) => value !== null) && obstacle[3] > 0;

// One step's state: end position and axis for each module, or null where any of them was not seen.
function readState(row, turn) {
  if (row.includes(null)) return null;
  const state = [];
  for (let k = 0; k < row.length; k += 6) {
    state.push({
      position: turn(scaled(row.slice(k, k + 3), 1 / PER_UNIT)),
      axis: unit(turn(row.slice(k + 3, k + 6))),
    });
  }
  return state;
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

// A value between two steps; the nearer one's where only one is known.
function valueAt(values, { step, share }, mix) {
  const here = values[step],
    next = values[Math.min(step + 1, values.length - 1)];
  if (here === null || next === null) return share < 0.5 ? here : next;
  return mix(here, next, share);
}

const mixNumbers = (a, b, share) => a + (b - a) * share;
const mixStates = (a, b, share) =>
  a.map((one, k) => ({
    position: between(one.position, b[k].position, share),
    axis: unit(between(one.axis, b[k].axis, share)),
  }));
const mixObstacles = (a, b, share) =>
  a.length !== b.length
    ? a
    : a.map((one, k) => ({
        centre: between(one.centre, b[k].centre, share),
        radius: mixNumbers(one.radius, b[k].radius, share),
      }));

// Everything of one trace at one time.
function momentOf(trace, time) {
  const place = stepAt(trace.times, time);
  const points = (asked) =>
    asked
      .map(({ module, points }) => ({ module, point: valueAt(points, place, between) }))
      .filter(({ point }) => point);
  return {
    place,
    state: valueAt(trace.states, place, mixStates),
    wanted: points(trace.wanted),
    axes: points(trace.axes).map(({ module, point }) => ({ module, axis: unit(point) })),
    obstacles: trace.obstacles.length > 1 ? valueAt(trace.obstacles, place, mixObstacles) : trace.obstacles[0],
    error: valueAt(trace.errors, place, mixNumbers),
    axisError: valueAt(trace.axisErrors, place, mixNumbers),
  };
}
