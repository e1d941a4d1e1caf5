// What stands round the arm: ground grid, shadow, base plate, ghosts, paths, targets, obstacles.

const OBSTACLE = "#8a93a6";

// A round grid on the plane that the arm is mounted on, as wide as the run reaches.
function groundOf(reach) {
  const spacing = roundAbove(reach / 6);
  return { spacing, radius: Math.ceil((1.05 * reach) / spacing) * spacing };
}

const RIM = Array.from({ length: 73 }, (_, k) => (k * Math.PI) / 36);
const rimOf = (radius, { x, y }) =>
  RIM.map((turn) => add(scaled(x, radius * Math.cos(turn)), scaled(y, radius * Math.sin(turn))));

function paintGround(context, camera, frame, { spacing, radius }) {
  const at = (a, b) => camera.project(add(scaled(frame.x, a), scaled(frame.y, b)));
  const rim = rimOf(radius, frame).map((point) => camera.project(point));
  tracePlaces(context, rim, true);
  context.fillStyle = "rgba(255,255,255,0.72)";
  context.fill();
  for (let place = -radius; place <= radius + 1e-9; place += spacing) {
    const half = Math.sqrt(Math.max(0, radius ** 2 - place ** 2));
    const stroke = Math.abs(place) < 1e-9 ? "#b3bdc9" : "#d9dfe7";
    paintLine(context, { places: [at(place, -half), at(place, half)], stroke, width: 1 });
    paintLine(context, { places: [at(-half, place), at(half, place)], stroke, width: 1 });
  }
  paintLine(context, { places: rim, stroke: "#cdd5de", width: 1.2 });
  nameAxes(context, at, radius);
  return spacing;
}

function nameAxes(context, at, radius) {
  context.font = "600 12px system-ui, sans-serif";
  context.fillStyle = "#7a8594";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const [name, place] of [
    ["x", at(radius * 1.06, 0)],
    ["y", at(0, radius * 1.06)],
  ])
    context.fillText(name, place.x, place.y);
}

// The arm's shadow straight down on the ground.
function paintShadow(context, camera, line) {
  const places = line.map(({ position }) => camera.project([position[0], position[1], 0]));
  const width = 2 * line[0].radius * places[0].scale;
  for (let wide = 0.5; wide < 1.7; wide += 0.12) {
    paintLine(context, { places, stroke: "rgba(30,42,66,0.022)", width: width * wide });
  }
}

function pushBase(things, camera, light, run) {
  const radius = BODY * run.arm.radii[0];
  const point = { position: [0, 0, 0], tangent: run.frame.z, x: run.frame.x, y: run.frame.y };
  pushDisc(things, camera, light, point, 2 * radius, [0, 0.16 * radius], [radius, 1.4 * radius], [122, 133, 148]);
  pushDisc(
    things,
    camera,
    light,
    point,
    1.4 * radius,
    [0.16 * radius, COLLAR * radius],
    [radius, radius],
    [160, 170, 184],
  );
}

// Another controller's arm: its outline on the screen, see-through.
function paintGhost(context, camera, state, run, colour) {
  const line = centreLine(state, run.arm, run.frame);
  const places = line.map((point) => ({ ...camera.project(point.position), radius: point.radius }));
  const left = [],
    right = [];
  places.forEach((place, k) => {
    const [before, after] = [places[Math.max(k - 1, 0)], places[Math.min(k + 1, places.length - 1)]];
    const size = Math.hypot(after.x - before.x, after.y - before.y) || 1;
    const [dx, dy] = [(after.y - before.y) / size, (before.x - after.x) / size].map(
      (d) => d * place.radius * place.scale,
    );
    left.push({ x: place.x + dx, y: place.y + dy });
    right.unshift({ x: place.x - dx, y: place.y - dy });
  });
  tracePlaces(context, [...left, ...right], true);
  context.fillStyle = veil(colour, 0.16);
  context.strokeStyle = veil(colour, 0.65);
  context.lineWidth = 1.2;
  context.fill();
  context.stroke();
}

// A path as line pieces for the painter, broken where a point is missing; long paths are thinned for drawing only.
function pushPath(things, camera, points, stroke, width, closer = 0) {
  const stride = Math.ceil(points.length / 500);
  const shown = points.filter((_, k) => k % stride === 0 || k === points.length - 1);
  let last = null;
  for (const point of shown) {
    const place = point && camera.project(point);
    if (place && last)
      things.push({
        kind: "line",
        depth: (place.depth + last.depth) / 2 - closer,
        places: [last, place],
        stroke,
        width,
      });
    last = place;
  }
}

function pushObstacles(things, camera, obstacles) {
  for (const { centre, radius } of obstacles) {
    const place = camera.project(centre);
    things.push({ kind: "ball", depth: place.depth, place, radius: radius * place.scale, colour: OBSTACLE });
  }
}

function paintDot(context, place, radius, fill) {
  context.beginPath();
  context.arc(place.x, place.y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
}

// The target: a dot in a ring, in front of everything.
function paintTarget(context, place, colour) {
  paintDot(context, place, 9.5, "rgba(255,255,255,0.9)");
  context.beginPath();
  context.arc(place.x, place.y, 7.5, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 2.4;
  context.stroke();
  paintDot(context, place, 3.2, colour);
}

// An arrow from a point along a unit vector, with a white edge so that it shows on any ground.
function paintArrow(context, camera, start, axis, size, colour, width) {
  const [tail, tip] = [start, along(start, axis, size)].map((p) => camera.project(p));
  const pixels = Math.hypot(tip.x - tail.x, tip.y - tail.y);
  if (pixels < 3) return;
  const [ux, uy] = [(tip.x - tail.x) / pixels, (tip.y - tail.y) / pixels];
  const head = Math.min(4.2 * width, pixels * 0.7);
  const neck = { x: tip.x - ux * head, y: tip.y - uy * head };
  const barbs = [1, -1].map((side) => ({ x: neck.x - side * uy * head * 0.5, y: neck.y + side * ux * head * 0.5 }));
  for (const [stroke, extra] of [
    ["rgba(255,255,255,0.9)", 3],
    [colour, 0],
  ]) {
    paintLine(context, { places: [tail, neck], stroke, width: width + extra });
    tracePlaces(context, [tip, ...barbs], true);
    context.strokeStyle = context.fillStyle = stroke;
    context.lineWidth = Math.max(extra, 0.5);
    context.stroke();
    context.fill();
  }
}
