// The flight in three dimensions. Inside of `world` all is north, east, down in metres, as everywhere in the data.
"use strict";

const SHOWN_AFTER_HIT_S = 4;
const NEAREST_M = 0.3;
const FARTHEST_M = 500;

function makeScene(canvas) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(50, 1, 0.02, 2000);
  const world = new THREE.Group();
  // North is away from the viewer, east to the right, down is down.
  world.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(
    new THREE.Vector3(0, 0, -1), new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, -1, 0)));
  scene.add(world, new THREE.HemisphereLight(0xffffff, 0x777777, 1.1));
  const sun = new THREE.DirectionalLight(0xffffff, 0.6);
  sun.position.set(2, 5, 3);
  scene.add(sun);
  const view = { turn: 0.7, tilt: 0.5, away: 2.2, centre: new THREE.Vector3(), follows: true };
  const moving = fill(world);
  let now = 0;

  function draw() {
    const { clientWidth, clientHeight } = canvas;
    if (!clientWidth || !clientHeight) return;
    renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / clientHeight;
    camera.updateProjectionMatrix();
    const flat = view.away * Math.cos(view.tilt);
    camera.position.set(
      view.centre.x - flat * Math.sin(view.turn),
      view.centre.y + view.away * Math.sin(view.tilt),
      view.centre.z + flat * Math.cos(view.turn));
    camera.lookAt(view.centre);
    renderer.render(scene, camera);
  }

  function show(time) {
    now = time;
    const place = moving.show(time);
    if (view.follows && place) view.centre.copy(world.localToWorld(place));
    draw();
  }

  handle(canvas, view, draw);
  return { show, draw, view, restyle: () => { moving.restyle(); show(now); } };
}

// All that is to be seen; what moves is put in its place by `show`.
function fill(world) {
  const styled = [];
  const coloured = (material, variable) => {
    styled.push(() => material.color.set(colour(variable)));
    return material;
  };
  const surface = (variable, opacity) =>
    coloured(new THREE.MeshLambertMaterial({ transparent: opacity < 1, opacity, side: THREE.DoubleSide, depthWrite: opacity === 1 }), variable);
  const line = (variable, opacity = 1) =>
    coloured(new THREE.LineBasicMaterial({ transparent: opacity < 1, opacity }), variable);
  const make = { surface, line, styled };
  const shows = [];
  if (flight.has_places) {
    shows.push(...flight.obstacles.map((obstacle) => addObstacle(world, obstacle, make)));
    shows.push(...flight.surfaces.map((known) => addSurface(world, known, make)));
    shows.push(...flight.moments.filter((moment) => moment.place && moment.normal).map((moment) => addContact(world, moment, make)));
    addPath(world, make);
    shows.push(addSetpoint(world, make));
  }
  addGround(world, make);
  const vehicle = addVehicle(world, make, "--blue", "--orange", 1);
  const ghost = tables.truth && flight.has_places ? addVehicle(world, make, "--grey", "--grey", 0.35) : null;
  const restyle = () => styled.forEach((style) => style());
  restyle();
  return {
    restyle,
    show(time) {
      shows.forEach((one) => one(time));
      const folds = at(tables.truth, FOLDS, time);
      const place = vehicle(at(tables.path, ["n", "e", "d"], time), turnAt(tables.attitude, time), folds);
      if (ghost) ghost(at(tables.truth, ["n", "e", "d"], time), turnAt(tables.truth, time), folds);
      return place;
    },
  };
}

function turnAt(table, time) {
  const parts = at(table, ["qw", "qx", "qy", "qz"], time);
  if (!parts || !parts.every(Number.isFinite)) return null;
  const [w, x, y, z] = parts;
  return new THREE.Quaternion(x, y, z, w).normalize();
}

function addGround(world, make) {
  let reach = 4;
  for (const name of ["n", "e"]) for (const value of tables.path.columns[name] || []) reach = Math.max(reach, Math.abs(value) || 0);
  const size = Math.min(2000, 2 * Math.ceil(1.3 * reach));
  const points = [];
  const step = size > 200 ? 10 : 1;
  for (let along = -size / 2; along <= size / 2; along += step) {
    points.push(along, -size / 2, 0, along, size / 2, 0, -size / 2, along, 0, size / 2, along, 0);
  }
  const grid = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  world.add(new THREE.LineSegments(grid, make.line("--line", 0.8)));
}

// A hub with a nose, and arms with their guards; an arm that folds moves inward.
function addVehicle(world, make, body, nose, opacity) {
  const { arms, radius, height } = flight.vehicle;
  const whole = new THREE.Group();
  const hub = new THREE.Mesh(new THREE.BoxGeometry(0.1, 0.08, 0.04), make.surface(body, opacity));
  const front = new THREE.Mesh(new THREE.ConeGeometry(0.025, 0.06, 12).rotateZ(-Math.PI / 2), make.surface(nose, opacity));
  front.position.x = 0.08;
  whole.add(hub, front);
  const guards = arms.map(([ahead, aside]) => {
    const arm = new THREE.Group();
    arm.rotation.z = Math.atan2(aside, ahead);
    const beam = new THREE.Mesh(new THREE.BoxGeometry(1, 0.018, 0.014).translate(0.5, 0, 0), make.surface(body, opacity));
    const guard = new THREE.Group();
    const ring = new THREE.Mesh(new THREE.TorusGeometry(radius, Math.max(0.004, height / 5), 8, 36), make.surface(ahead > 0 ? nose : body, opacity));
    const disc = new THREE.Mesh(new THREE.CircleGeometry(0.85 * radius, 32), make.surface("--grey", 0.25 * opacity));
    guard.add(ring, disc);
    arm.add(beam, guard);
    whole.add(arm);
    return { beam, guard, length: Math.hypot(ahead, aside) };
  });
  world.add(whole);
  return (place, turn, folds) => {
    whole.visible = Boolean(turn || place);
    if (place && place.every(Number.isFinite)) whole.position.set(...place);
    if (turn) whole.quaternion.copy(turn);
    guards.forEach(({ beam, guard, length }, number) => {
      const reach = length - (folds && Number.isFinite(folds[number]) ? folds[number] : 0);
      beam.scale.x = reach;
      guard.position.x = reach;
    });
    return whole.position.clone();
  };
}

function addObstacle(world, obstacle, make) {
  const group = new THREE.Group();
  const solid = new THREE.Mesh(shapeOf(obstacle), make.surface("--stone", 0.4));
  solid.add(new THREE.LineSegments(new THREE.EdgesGeometry(solid.geometry, 30), make.line("--stone")));
  group.add(solid);
  world.add(group);
  if (!obstacle.motion) return () => {};
  const { t, offsets } = obstacle.motion;
  const table = { length: t.length, has: () => true, columns: { t, n: offsets.map((o) => o[0]), e: offsets.map((o) => o[1]), d: offsets.map((o) => o[2]) } };
  return (time) => group.position.set(...at(table, ["n", "e", "d"], time));
}

function shapeOf(obstacle) {
  if (obstacle.kind === "pole") {
    const axis = new THREE.Vector3(...obstacle.axis);
    const upright = new THREE.CylinderGeometry(obstacle.radius, obstacle.radius, obstacle.height, 24).translate(0, obstacle.height / 2, 0);
    return upright.applyQuaternion(new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis)).translate(...obstacle.foot);
  }
  const axes = obstacle.axes.map((axis) => new THREE.Vector3(...axis));
  return new THREE.BoxGeometry(...obstacle.sizes).applyMatrix4(new THREE.Matrix4().makeBasis(...axes)).translate(...obstacle.centre);
}

// What is remembered of a surface, from one touch of it to the next.
function addSurface(world, known, make) {
  const corners = known.corners.flat();
  const triangles = [];
  for (let corner = 1; corner + 1 < known.corners.length; corner += 1) triangles.push(0, corner, corner + 1);
  const shape = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
  const outline = new THREE.LineLoop(shape, make.line("--purple"));
  const filled = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
  filled.setIndex(triangles);
  filled.computeVertexNormals();
  const patch = new THREE.Mesh(filled, make.surface("--purple", 0.4));
  world.add(outline, patch);
  return (time) => { outline.visible = patch.visible = time >= known.t && (known.until === null || time < known.until); };
}

// Where it touched, the normal, and the cone that the normal lies in with two chances of three.
function addContact(world, moment, make) {
  const normal = new THREE.Vector3(...moment.normal).normalize();
  const reach = flight.vehicle.centre + flight.vehicle.radius;
  const touched = new THREE.Vector3(...moment.place).addScaledVector(normal, -reach);
  const always = new THREE.Mesh(new THREE.SphereGeometry(0.03, 16, 12), make.surface("--red", 1));
  always.position.copy(touched);
  const group = new THREE.Group();
  group.position.copy(touched);
  group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), normal);
  const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.008, 0.008, 0.4, 10).translate(0, 0.2, 0), make.surface("--red", 1));
  const head = new THREE.Mesh(new THREE.ConeGeometry(0.03, 0.09, 14).translate(0, 0.44, 0), make.surface("--red", 1));
  group.add(shaft, head);
  if (moment.error_deg > 0) {
    const wide = 0.45 * Math.tan(Math.min(moment.error_deg, 75) * Math.PI / 180);
    const cone = new THREE.ConeGeometry(wide, 0.45, 32, 1, true).rotateX(Math.PI).translate(0, 0.225, 0);
    group.add(new THREE.Mesh(cone, make.surface("--red", 0.22)));
  }
  world.add(always, group);
  return (time) => {
    always.visible = time >= moment.t;
    group.visible = time >= moment.t && time < moment.t + SHOWN_AFTER_HIT_S;
  };
}

function addPath(world, make) {
  const shape = new THREE.BufferGeometry();
  // Filled anew with each style: a live path has grown by then.
  make.styled.push(() => {
    const { t, n, e, d } = tables.path.columns;
    const places = new Float32Array(3 * t.length);
    const colours = new Float32Array(3 * t.length);
    const known = {};
    t.forEach((time, row) => {
      places.set([n[row], e[row], d[row]], 3 * row);
      const variable = pathColour(time);
      known[variable] = known[variable] || new THREE.Color(colour(variable));
      known[variable].toArray(colours, 3 * row);
    });
    shape.setAttribute("position", new THREE.BufferAttribute(places, 3));
    shape.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  });
  // A line is a pixel wide whatever is asked for; its points make it a thick one.
  const drawn = [
    new THREE.Line(shape, new THREE.LineBasicMaterial({ vertexColors: true })),
    new THREE.Points(shape, new THREE.PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false })),
  ];
  for (const one of drawn) one.frustumCulled = false;
  world.add(...drawn);
}

function addSetpoint(world, make) {
  const marker = new THREE.Mesh(new THREE.OctahedronGeometry(0.05), make.surface("--ink", 0.9));
  const towards = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
  const thread = new THREE.Line(towards, make.line("--ink"));
  thread.frustumCulled = false;
  world.add(marker, thread);
  const table = tables.setpoint;
  return (time) => {
    const row = table.length ? rowAt(table.columns.t, time) : -1;
    const place = row < 0 ? null : ["n", "e", "d"].map((name) => table.columns[name][row]);
    // Setpoints come twice a second at least while somebody sends any.
    const shown = place !== null && place.every(Number.isFinite) && time - table.columns.t[row] < 0.6;
    marker.visible = thread.visible = shown;
    const from = at(tables.path, ["n", "e", "d"], time);
    if (!shown || !from) return;
    marker.position.set(...place);
    towards.attributes.position.array.set([...from, ...place]);
    towards.attributes.position.needsUpdate = true;
  };
}

// One finger or the mouse turns, two fingers or the wheel come nearer.
function handle(canvas, view, draw) {
  const fingers = new Map();
  const nearer = (factor) => {
    view.away = Math.min(FARTHEST_M, Math.max(NEAREST_M, view.away * factor));
    draw();
  };
  const apart = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.addEventListener("pointerdown", (down) => {
    canvas.setPointerCapture(down.pointerId);
    fingers.set(down.pointerId, { x: down.clientX, y: down.clientY });
  });
  canvas.addEventListener("pointermove", (moved) => {
    const finger = fingers.get(moved.pointerId);
    if (!finger) return;
    const before = fingers.size === 2 ? apart() : 0;
    if (fingers.size === 1) {
      view.turn += 0.008 * (moved.clientX - finger.x);
      view.tilt = Math.min(1.55, Math.max(-0.3, view.tilt + 0.008 * (moved.clientY - finger.y)));
    }
    finger.x = moved.clientX;
    finger.y = moved.clientY;
    if (fingers.size === 2 && before > 0) nearer(before / Math.max(apart(), 1));
    else draw();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (up) => fingers.delete(up.pointerId));
  canvas.addEventListener("wheel", (wheel) => {
    wheel.preventDefault();
    nearer(Math.exp(0.001 * wheel.deltaY));
  }, { passive: false });
  view.nearer = nearer;
}
