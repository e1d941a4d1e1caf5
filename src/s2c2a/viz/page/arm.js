// The arm's body: a centre-line through the module ends, skinned as a tube with discs and cables.

const AROUND = 32;
const BODY = 1.12; // radius of the body as a share of the cable radius; an arm file does not state it
const COLLAR = 0.4; // height of the base's collar as a share of the body's radius
const DISC = [196, 203, 213];

// Points of the centre-line with tangent, module and radius; as shape.py, a cubic Hermite curve for each module.
function centreLine(state, arm, frame) {
  const steps = clamp(Math.round(120 / state.length), 6, 16);
  const radii = rimRadii(arm);
  const points = [];
  let start = { position: [0, 0, 0], axis: frame.z };
  state.forEach((end, module) => {
    for (let k = module ? 1 : 0; k <= steps; k++) {
      const share = k / steps;
      points.push({
        ...hermite(start, end, arm.lengths[module], share),
        module,
        radius: mixNumbers(radii[module], radii[module + 1], share),
      });
    }
    start = end;
  });
  return carryFrame(points, frame.x);
}

function hermite(start, end, size, u) {
  const mix = (a, b, c, d) =>
    add(
      add(scaled(start.position, a), scaled(start.axis, b * size)),
      add(scaled(end.position, c), scaled(end.axis, d * size)),
    );
  const [uu, uuu] = [u * u, u * u * u];
  return {
    position: mix(2 * uuu - 3 * uu + 1, uuu - 2 * uu + u, 3 * uu - 2 * uuu, uuu - uu),
    tangent: unit(mix(6 * uu - 6 * u, 3 * uu - 4 * u + 1, 6 * u - 6 * uu, 3 * uu - 2 * u)),
  };
}

// Body radius at the base and at every module end: between neighbours their mean.
function rimRadii({ radii }) {
  const last = radii.length - 1;
  const inner = radii.slice(1).map((radius, k) => (radius + radii[k]) / 2);
  return [radii[0], ...inner, radii[last]].map((radius) => BODY * radius);
}

// Carry the x axis along the line without twist.
function carryFrame(points, x) {
  for (const point of points) {
    x = point.x = squareTo(x, point.tangent);
    point.y = cross(point.tangent, x);
  }
  return points;
}

const TURNS = Array.from({ length: AROUND }, (_, k) => (2 * Math.PI * k) / AROUND);
const outward = (point, angle) => add(scaled(point.x, Math.cos(angle)), scaled(point.y, Math.sin(angle)));
const ringOf = (point, radius) => TURNS.map((angle) => along(point.position, outward(point, angle), radius));

// Faces between two rings that face the eye.
function pushBand(things, camera, light, lower, upper, rgb) {
  const rings = [lower, upper].map(({ point, radius }) =>
    ringOf(point, radius).map((p) => ({ ...camera.project(p), p })),
  );
  for (let k = 0; k < AROUND; k++) {
    const next = (k + 1) % AROUND;
    const places = [rings[0][k], rings[0][next], rings[1][next], rings[1][k]];
    const normal = outward(lower.point, TURNS[k] + Math.PI / AROUND);
    if (dot(normal, subtract(camera.eye, places[0].p)) <= 0) continue;
    things.push({ kind: "face", depth: meanDepth(places), places, fill: lit(rgb, normal, light) });
  }
}

// A ring-shaped plate square to the line at `point`, from `inner` to `radius`, drawn where it faces the eye.
function pushPlate(things, camera, light, point, inner, radius, side, rgb) {
  const normal = scaled(point.tangent, side);
  if (dot(normal, subtract(camera.eye, point.position)) <= 0) return;
  const fill = lit(rgb, normal, light);
  const bias = inner > 0 ? 0.3 * inner : -0.5 * radius; // a body stands before its plate, the tip's plate before all
  const [inside, outside] = [inner, radius].map((size) => ringOf(point, size).map((p) => camera.project(p)));
  outside.forEach((place, k) => {
    const next = (k + 1) % AROUND;
    const places = [inside[k], place, outside[next], inside[next]];
    things.push({ kind: "face", depth: meanDepth(places) + bias, places, fill });
  });
}

// A short cylinder from `low` to `high` metres along the tangent at `point`; its plates start where the body ends.
function pushDisc(things, camera, light, point, radius, [low, high], [innerLow, innerHigh], rgb) {
  const ends = [low, high].map((k) => ({ ...point, position: along(point.position, point.tangent, k) }));
  pushBand(things, camera, light, { point: ends[0], radius }, { point: ends[1], radius }, rgb);
  pushPlate(things, camera, light, ends[0], innerLow, radius, -1, rgb);
  pushPlate(things, camera, light, ends[1], innerHigh, radius, 1, rgb);
}

function pushTube(things, camera, light, line, colours) {
  for (let k = 0; k + 1 < line.length; k++) {
    const [lower, upper] = [line[k], line[k + 1]].map((point) => ({ point, radius: point.radius }));
    pushBand(things, camera, light, lower, upper, rgbOf(colours[upper.point.module]));
  }
}

// The cables of each module along its body, on the side that faces the eye.
function pushCables(things, camera, line, arm) {
  for (let k = 0; k + 1 < line.length; k++) {
    const ends = [line[k], line[k + 1]];
    const module = ends[1].module;
    for (const angle of arm.cableAngles[module]) {
      const normal = outward(ends[0], angle);
      const points = ends.map((end) => along(end.position, outward(end, angle), end.radius * 1.01));
      if (dot(normal, unit(subtract(camera.eye, points[0]))) <= 0.05) continue;
      const places = points.map((p) => camera.project(p));
      const stroke = cssOf(scaled(rgbOf(arm.colours[module]), 0.5));
      things.push({
        kind: "line",
        depth: meanDepth(places) - 0.12 * ends[0].radius,
        places,
        stroke,
        width: Math.max(1, places[0].scale * 0.0022),
      });
    }
  }
}

// The line from the top of the base's collar on, so that nothing shows through it.
function aboveCollar(line) {
  const height = COLLAR * line[0].radius;
  const start = { ...line[0], position: along(line[0].position, line[0].tangent, height) };
  return [start, ...line.filter((point) => point.module > 0 || length(point.position) > 1.05 * height)];
}

function pushDiscs(things, camera, light, line, moduleCount) {
  line.forEach((point, k) => {
    if (k + 1 < line.length && line[k + 1].module === point.module) return;
    const thick = 0.14 * point.radius,
      tip = point.module === moduleCount - 1;
    const span = tip ? [-2 * thick, 0] : [-thick, thick];
    pushDisc(things, camera, light, point, 1.16 * point.radius, span, [point.radius, tip ? 0 : point.radius], DISC);
  });
}

// Everything of the arm's body for the painter.
function pushArm(things, camera, light, state, run) {
  const line = centreLine(state, run.arm, run.frame);
  pushTube(things, camera, light, aboveCollar(line), run.arm.colours);
  pushCables(things, camera, aboveCollar(line), run.arm);
  pushDiscs(things, camera, light, line, state.length);
  return line;
}
