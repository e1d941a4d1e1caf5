// Surroundings of the arm: ground plane, shadow, gravity, ghosts, paths, targets, obstacles.

const RIM = Array.from({ length: 73 }, (_, k) => (k * Math.PI) / 36);
const rimOf = ({ radius, level }, share = 1) =>
  RIM.map((angle) => [...[Math.cos(angle), Math.sin(angle)].map((x) => share * radius * x), level]);

function paintGround(context, camera, { surroundings, colors }) {
  const rim = rimOf(surroundings).map((p) => camera.project(p));
  tracePlaces(context, rim, true);
  context.fillStyle = "rgba(255,255,255,0.72)";
  context.fill();
  surroundings.grid.forEach((ends, k) => {
    const stroke = surroundings.through_origin[k] ? colors.strong : colors.grid;
    paintLine(context, { places: ends.map((p) => camera.project(p)), stroke, width: 1 });
  });
  paintLine(context, { places: rim, stroke: colors.grid, width: 1.2 });
  for (const [name, p] of Object.entries(surroundings.names)) paintText(context, camera.project(p), name);
}

function paintText(context, place, text) {
  context.font = "600 12px system-ui, sans-serif";
  context.fillStyle = "#7a8594";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(text, place.x, place.y);
}

function paintGravity(context, camera, { surroundings: { arrow }, colors }) {
  if (!arrow) return;
  const tail = arrow[0];
  const offset = subtract(arrow[1], tail);
  paintArrow(context, camera, tail, unit(offset), length(offset), colors.ink, 2.4);
  const place = camera.project(tail);
  paintText(context, { ...place, y: place.y - 12 }, "gravity");
}

// The arm's shadow straight down on the plane.
function paintShadow(context, camera, body, level) {
  const places = body.map(({ position }) => camera.project([position[0], position[1], level]));
  const width = 2 * body[0].radius * places[0].scale;
  for (let wide = 0.5; wide < 1.7; wide += 0.12) {
    paintLine(context, { places, stroke: "rgba(30,42,66,0.022)", width: width * wide });
  }
}

// Another strategy's arm: its outline on the screen, translucent.
function paintGhost(context, camera, body, color) {
  const places = body.map(({ position, radius }) => ({ ...camera.project(position), radius }));
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
  context.fillStyle = veil(color, 0.16);
  context.strokeStyle = veil(color, 0.65);
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

function pushObstacles(things, camera, obstacles, color) {
  for (const { center, radius, surface } of obstacles) {
    if (surface.length) {
      const places = surface.map((offset) => camera.project(add(center, offset)));
      things.push({ kind: "solid", depth: meanDepth(places), places: hullOf(places), color });
      continue;
    }
    const place = camera.project(center);
    things.push({ kind: "ball", depth: place.depth, place, radius: radius * place.scale, color });
  }
}

// Corners of the convex hull of places on the screen (Andrew's monotone chain).
function hullOf(places) {
  const sorted = [...places].sort((a, b) => a.x - b.x || a.y - b.y);
  const turnsLeft = (a, b, c) => (b.x - a.x) * (c.y - a.y) > (b.y - a.y) * (c.x - a.x);
  const chainOf = (points) => {
    const chain = [];
    for (const place of points) {
      while (chain.length > 1 && !turnsLeft(chain[chain.length - 2], chain[chain.length - 1], place)) chain.pop();
      chain.push(place);
    }
    return chain.slice(0, -1);
  };
  return [...chainOf(sorted), ...chainOf(sorted.reverse())];
}

// The tube around the predicted path: one fill, since overlaps of translucent discs would add up.
function paintTube(context, camera, balls, color) {
  context.beginPath();
  for (const ball of balls) {
    if (!ball) continue;
    const { x, y, scale } = camera.project(ball.center);
    context.moveTo(x + ball.radius * scale, y);
    context.arc(x, y, ball.radius * scale, 0, 2 * Math.PI);
  }
  context.fillStyle = veil(color, 0.16);
  context.fill();
}

function paintDot(context, place, radius, fill) {
  context.beginPath();
  context.arc(place.x, place.y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
}

// The target: a dot in a ring, in front of everything.
function paintTarget(context, place, color) {
  paintDot(context, place, 9.5, "rgba(255,255,255,0.9)");
  context.beginPath();
  context.arc(place.x, place.y, 7.5, 0, 2 * Math.PI);
  context.strokeStyle = color;
  context.lineWidth = 2.4;
  context.stroke();
  paintDot(context, place, 3.2, color);
}

// An arrow from a point along a unit vector, with a white edge so that it shows on any ground.
function paintArrow(context, camera, start, axis, size, color, width) {
  const [tail, tip] = [start, along(start, axis, size)].map((p) => camera.project(p));
  const pixels = Math.hypot(tip.x - tail.x, tip.y - tail.y);
  if (pixels < 3) return;
  const [ux, uy] = [(tip.x - tail.x) / pixels, (tip.y - tail.y) / pixels];
  const head = Math.min(4.2 * width, pixels * 0.7);
  const neck = { x: tip.x - ux * head, y: tip.y - uy * head };
  const barbs = [1, -1].map((side) => ({ x: neck.x - side * uy * head * 0.5, y: neck.y + side * ux * head * 0.5 }));
  for (const [stroke, extra] of [
    ["rgba(255,255,255,0.9)", 3],
    [color, 0],
  ]) {
    paintLine(context, { places: [tail, neck], stroke, width: width + extra });
    tracePlaces(context, [tip, ...barbs], true);
    context.strokeStyle = context.fillStyle = stroke;
    context.lineWidth = Math.max(extra, 0.5);
    context.stroke();
    context.fill();
  }
}
