// Light and paint: colored faces, lines and balls, painted from far to near.

const rgbOf = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
const cssOf = (rgb) => `rgb(${rgb.map((value) => Math.round(clamp(value, 0, 255))).join(",")})`;
const tint = (hex, share, ground = [243, 245, 249]) => cssOf(between(ground, rgbOf(hex), share));
const veil = (hex, share) => `rgba(${rgbOf(hex).join(",")},${share})`;

// A light from above and left of the eye.
function lightOf(camera) {
  const towards = unit(add(add(scaled(camera.back, 0.75), scaled(camera.up, 0.65)), scaled(camera.right, -0.45)));
  return { towards, half: unit(add(towards, camera.back)) };
}

// Color of a face of the given normal: soft diffuse light and a small highlight.
function lit(rgb, normal, light) {
  const diffuse = 0.62 + 0.42 * Math.max(0, dot(normal, light.towards));
  const shine = 62 * Math.max(0, dot(normal, light.half)) ** 28;
  return cssOf([rgb[0] * diffuse + shine, rgb[1] * diffuse + shine, rgb[2] * diffuse + shine]);
}

function tracePlaces(context, places, closed) {
  context.beginPath();
  places.forEach((place, k) => (k ? context.lineTo(place.x, place.y) : context.moveTo(place.x, place.y)));
  if (closed) context.closePath();
}

// A face; its edge is stroked in its own color to close the seams.
function paintFace(context, { places, fill }) {
  tracePlaces(context, places, true);
  context.fillStyle = context.strokeStyle = fill;
  context.lineWidth = 0.8;
  context.fill();
  context.stroke();
}

function paintLine(context, { places, stroke, width }) {
  tracePlaces(context, places, false);
  context.strokeStyle = stroke;
  context.lineWidth = width;
  context.stroke();
}

// A translucent ball: denser towards its rim, with a highlight.
function paintBall(context, { place, radius, color }) {
  const shade = context.createRadialGradient(
    place.x - radius * 0.35,
    place.y - radius * 0.4,
    radius * 0.05,
    place.x,
    place.y,
    radius,
  );
  shade.addColorStop(0, "rgba(255,255,255,0.75)");
  shade.addColorStop(0.35, veil(color, 0.3));
  shade.addColorStop(1, veil(color, 0.62));
  context.beginPath();
  context.arc(place.x, place.y, radius, 0, 2 * Math.PI);
  context.fillStyle = shade;
  context.fill();
  context.strokeStyle = veil(color, 0.8);
  context.lineWidth = 1;
  context.stroke();
}

// The outline of a translucent solid.
function paintSolid(context, { places, color }) {
  tracePlaces(context, places, true);
  context.fillStyle = veil(color, 0.32);
  context.strokeStyle = veil(color, 0.8);
  context.lineWidth = 1;
  context.fill();
  context.stroke();
}

const PAINTERS = { face: paintFace, line: paintLine, ball: paintBall, solid: paintSolid };

// Paint a list of objects, each with its kind and depth, the farthest first.
function paintByDepth(context, things) {
  things.sort((a, b) => b.depth - a.depth);
  for (const thing of things) PAINTERS[thing.kind](context, thing);
}

const meanDepth = (places) => places.reduce((sum, place) => sum + place.depth, 0) / places.length;
