// The arm's surface: tubes through sections. mesh.py defines the sections and how they follow the frames.

// Positions and axes of the sections, each between the frames at its module's start and end.
function sectionsAt(frames, mesh) {
  return mesh.sections.map(([module, start, slope, end, endSlope, share, radius]) => {
    const [from, to] = [frames[module], frames[module + 1]];
    const [x, z] = ["x", "z"].map((name) => unit(between(from[name], to[name], share)));
    return {
      position: add(
        add(scaled(from.position, start), scaled(from.z, slope)),
        add(scaled(to.position, end), scaled(to.z, endSlope)),
      ),
      x: scaled(x, radius),
      y: scaled(cross(z, x), radius),
      radius,
    };
  });
}

const cornerOf = (section, [a, b]) => along(along(section.position, section.x, a), section.y, b);

// The faces of a strand that are turned to the eye, for the painter.
function pushStrand(things, camera, light, sections, outline, rgb, lift) {
  const rings = sections.map((section) =>
    outline.map((place) => {
      const p = cornerOf(section, place);
      return { ...camera.project(p), p };
    }),
  );
  for (let ring = 0; ring + 1 < rings.length; ring++) {
    for (let k = 0; k < outline.length; k++) {
      const next = (k + 1) % outline.length;
      const places = [rings[ring][k], rings[ring][next], rings[ring + 1][next], rings[ring + 1][k]];
      const normal = cross(subtract(places[2].p, places[0].p), subtract(places[3].p, places[1].p));
      if (dot(normal, subtract(camera.eye, places[0].p)) <= 0) continue;
      things.push({ kind: "face", depth: meanDepth(places) - lift, places, fill: lit(rgb, unit(normal), light) });
    }
  }
}

// All faces of the arm for the painter.
function pushArm(things, camera, light, sections, mesh) {
  for (const { color, tubes, outlines, lift } of mesh.pieces) {
    for (const outline of outlines) {
      for (const [first, last] of tubes)
        pushStrand(things, camera, light, sections.slice(first, last), outline, rgbOf(color), lift);
    }
  }
}

// The sections of the modules' tubes, base to tip: the arm as a line with a radius.
const bodyOf = (sections, run) => sections.slice(0, run.mesh.bodyRows * run.arm.lengths.length);
