// The graph is data in the page and, if Graphviz was available, a drawing. The page fetches and stores nothing.

const data = JSON.parse(document.getElementById("data").textContent);
const { nodes, edges, kinds, arrows, latency } = data;
const find = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

const { needs, neededBy } = neighboursOf(nodes.length, edges);
const boxes = new Map(data.boxes.map((box) => [box.key, box])); // what the overview shows instead of nodes

const LARGE = 100; // with more nodes than this, the page helps at once, and shows neighbourhoods instead of all nodes
const LEGIBLE = 0.9; // the smallest scale at which the overview opens
const state = {
  view: boxes.size ? "overview" : "whole",
  node: null, // the chosen node
  box: null, // the chosen box
  members: null, // the nodes of the part view, if it does not show the chosen node and its neighbours
  hidden: new Set(),
  help: nodes.length > LARGE,
};

// ---- small helpers

function element(name, attributes = {}, ...children) {
  const newElement = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) newElement.addEventListener(key.slice(2), value);
    else if (value !== null && value !== false) newElement.setAttribute(key, value === true ? "" : value);
  }
  newElement.append(...children);
  return newElement;
}

function shape(name, attributes = {}, ...children) {
  const newElement = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) newElement.setAttribute(key, value);
  newElement.append(...children);
  return newElement;
}

const nodeCountText = (list) => `${list.length} node${list.length === 1 ? "" : "s"}`;

// ---- drawing

const pen = document.createElement("canvas").getContext("2d");
pen.font = '12px "DejaVu Sans", Verdana, Arial, sans-serif';

function sizeOf(lines, kind) {
  const width = Math.max(40, ...lines.map((line) => pen.measureText(line).width));
  return { width: width + (kind === "observer" ? 44 : kind === "skill" ? 32 : 20), height: 12 + 15 * lines.length };
}

function outline(kind, width, height) {
  const w = width / 2, h = height / 2;
  if (kind === "observer") return shape("polygon", { points: `${-w},0 ${-w + 14},${-h} ${w - 14},${-h} ${w},0 ${w - 14},${h} ${-w + 14},${h}` });
  if (kind === "skill") return shape("polygon", { points: `${-w},${-h} ${w - 10},${-h} ${w},0 ${w - 10},${h} ${-w},${h}` });
  const round = kind === "context" || kind === "given" || kind === "type" || kind === "group" ? 7 : 0;
  return shape("rect", { x: -w, y: -h, width, height, rx: round });
}

function backwards(from, to) {
  // In a cycle, the node that needs another node can be left of that node or above it. The arrow passes below both nodes.
  const low = Math.max(from.y + from.height / 2, to.y + to.height / 2) + 46, foot = to.y + to.height / 2 + 7;
  const line = `M${from.x},${from.y + from.height / 2}C${from.x},${low} ${to.x},${low} ${to.x},${foot}`;
  return [line, `${to.x - 3.5},${foot} ${to.x},${foot - 7} ${to.x + 3.5},${foot}`];
}

function drawGraph(items, links) {
  const { at, ways } = layOut(items, links);
  const world = shape("g", { class: "world" });
  const forwards = (from, to, bends, both) => {
    const x1 = from.x + from.width / 2 + (both ? 7 : 0), x2 = to.x - to.width / 2 - 7;
    const stops = [{ x: x1, y: from.y }, ...bends, { x: x2, y: to.y }];
    const line = stops.slice(1).reduce((path, stop, index) => {
      const before = stops[index], bend = (stop.x - before.x) * 0.45;
      return `${path}C${before.x + bend},${before.y} ${stop.x - bend},${stop.y} ${stop.x},${stop.y}`;
    }, `M${stops[0].x},${stops[0].y}`);
    const heads = [`${x2},${to.y - 3.5} ${x2 + 7},${to.y} ${x2},${to.y + 3.5}`];
    if (both) heads.push(`${x1},${from.y - 3.5} ${x1 - 7},${from.y} ${x1},${from.y + 3.5}`);
    return [line, ...heads];
  };
  const edgeShapes = links.map(([from, to, kind], number) => {
    const ends = [from, to].map((end) => ({ ...at[end], width: items[end].width, height: items[end].height }));
    const [line, ...heads] = at[to].x - items[to].width / 2 > at[from].x + items[from].width / 2 ? forwards(...ends, ways[number], kind.endsWith("both")) : backwards(...ends);
    const newElement = shape("g", { class: `edge ${kind}` }, shape("path", { d: line }), ...heads.map((points) => shape("polygon", { points })));
    world.append(newElement);
    return newElement;
  });
  const nodeShapes = items.map((item, number) => {
    const newElement = shape("g", { class: `node ${item.kind}`, transform: `translate(${at[number].x} ${at[number].y})` }, outline(item.kind, item.width, item.height));
    item.lines.forEach((line, index) => {
      const text = shape("text", { "text-anchor": "middle", y: 4 + 15 * (index - (item.lines.length - 1) / 2) });
      if (index) text.setAttribute("class", "more");
      text.textContent = line;
      newElement.append(text);
    });
    world.append(newElement);
    return newElement;
  });
  return { world, nodeShapes, edgeShapes };
}

const nodeItem = (number) => {
  const { kind, label, latency } = nodes[number];
  const lines = latency ? [label, latency] : [label];
  return { kind, lines, ...sizeOf(lines, kind) };
};

// The shapes of a picture, by the nodes and edges that they show.

function picturePart(members) {
  const numbers = [...members].filter((number) => !state.hidden.has(nodes[number].kind)).sort((one, other) => one - other);
  const index = new Map(numbers.map((number, position) => [number, position]));
  const inside = edges.map((edge, number) => [edge, number]).filter(([[from, to]]) => index.has(from) && index.has(to));
  const { world, nodeShapes, edgeShapes } = drawGraph(numbers.map(nodeItem), inside.map(([[from, to, kind]]) => [index.get(from), index.get(to), kind]));
  return {
    world,
    nodes: new Map(numbers.map((number, position) => [number, nodeShapes[position]])),
    edges: new Map(inside.map(([, number], position) => [number, edgeShapes[position]])),
  };
}

function copyOf(drawing) {
  const world = shape("g", { class: "world" });
  world.append(...[...drawing.children].map((child) => child.cloneNode(true)));
  return world;
}

function pictureWhole() {
  const given = find("drawing").querySelector("svg");
  if (!given) return picturePart(nodes.keys());
  const world = copyOf(given);
  const shapes = (letter, list) => new Map(list.map((_, number) => [number, world.querySelector(`#${letter}${number}`)]).filter(([, svgShape]) => svgShape));
  const picture = { world, nodes: shapes("n", nodes), edges: shapes("e", edges) };
  for (const [number, svgShape] of picture.nodes) svgShape.classList.toggle("gone", state.hidden.has(nodes[number].kind));
  for (const [number, svgShape] of picture.edges) svgShape.classList.toggle("gone", edges[number].slice(0, 2).some((end) => state.hidden.has(nodes[end].kind)));
  return picture;
}

function pictureOverview() {
  const list = [...boxes.values()];
  const given = find("overview").querySelector("svg");
  const items = list.map(({ lines }) => ({ kind: "group", lines, ...sizeOf(lines, "group") }));
  const world = given ? copyOf(given) : drawGraph(items, linksBetween(list, edges)).world;
  const shapes = list.map((box, number) => [box, given ? world.querySelector(`#n${number}`) : world.querySelectorAll(".node")[number]]);
  return {
    world,
    nodes: new Map(shapes.filter(([box]) => box.members.length === 1).map(([box, svgShape]) => [box.members[0], svgShape])),
    edges: new Map(),
    boxes: new Map(shapes.filter(([box]) => box.members.length > 1).map(([box, svgShape]) => [box.key, svgShape])),
  };
}

// ---- the stage: pan and zoom

const stage = find("stage");
let picture = null, view = { x: 0, y: 0, scale: 1 }, fitted = true;

function place() {
  picture.world.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.scale})`);
}

function extent(shapes) {
  const world = picture.inner.getScreenCTM().inverse();
  const corners = shapes.flatMap((svgShape) => {
    const there = world.multiply(svgShape.getScreenCTM()), own = svgShape.getBBox();
    return [[own.x, own.y], [own.x + own.width, own.y + own.height]].map(([x, y]) => new DOMPoint(x, y).matrixTransform(there));
  });
  const xs = corners.map((point) => point.x), ys = corners.map((point) => point.y);
  const [x, y] = [Math.min(...xs), Math.min(...ys)];
  return { x, y, width: Math.max(...xs) - x, height: Math.max(...ys) - y };
}

function fit(least = state.view === "overview" ? LEGIBLE : 0) {
  // Zoom to the chosen node and its neighbours, or else to the entire graph.
  const touched = state.node === null ? [] : [...picture.nodes.values()].filter((svgShape) => !svgShape.matches(".away, .gone"));
  const frame = stage.getBoundingClientRect(), box = touched.length ? extent(touched) : picture.inner.getBBox();
  if (!box.width || !frame.width) return;
  const scale = Math.max(Math.min((frame.width - 40) / box.width, (frame.height - 40) / box.height, 1.4), least);
  const margin = (room, size) => Math.max(20, (room - size * scale) / 2); // a picture that does not fit begins at the left and at the top
  view = { scale, x: margin(frame.width, box.width) - box.x * scale, y: margin(frame.height, box.height) - box.y * scale };
  fitted = true;
  place();
}

function zoom(factor, x = stage.clientWidth / 2, y = stage.clientHeight / 2) {
  fitted = false;
  const scale = Math.min(8, Math.max(0.02, view.scale * factor));
  view = { scale, x: x - ((x - view.x) * scale) / view.scale, y: y - ((y - view.y) * scale) / view.scale };
  place();
}

stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  const frame = stage.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), event.clientX - frame.left, event.clientY - frame.top);
}, { passive: false });

const fingers = new Map();
let moved = 0;
stage.addEventListener("pointerdown", (event) => { fingers.set(event.pointerId, event); moved = 0; });
window.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
  if (other) {
    const frame = stage.getBoundingClientRect();
    const distanceTo = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
    zoom(distanceTo(event) / Math.max(1, distanceTo(before)), other.clientX - frame.left, other.clientY - frame.top);
  } else {
    fitted = false;
    view.x += event.clientX - before.clientX;
    view.y += event.clientY - before.clientY;
    place();
  }
  moved += Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
  stage.classList.toggle("dragging", moved > 4);
  fingers.set(event.pointerId, event);
});
for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, (event) => { fingers.delete(event.pointerId); stage.classList.remove("dragging"); });

// ---- showing

function show({ refit = true } = {}) {
  const shownNodes = state.view === "part" ? partMembers() : null;
  picture = state.view === "overview" ? pictureOverview() : shownNodes ? picturePart(shownNodes) : pictureWhole();
  const outer = shape("svg", {});
  picture.inner = picture.world;
  picture.world = shape("g", {}, picture.inner);
  outer.append(picture.world);
  stage.replaceChildren(outer);
  prepare();
  mark();
  controls();
  updatePanel();
  if (refit) fit(); else place();
}

function partMembers() {
  const steps = Number(find("steps").value);
  if (state.node !== null) return new Set([...reach([state.node], needs, steps), ...reach([state.node], neededBy, steps)]);
  const own = state.members ?? [...nodes.keys()];
  return new Set([...own, ...reach(own, needs, 1)]);
}

function prepare() {
  const label = (number) => `${nodes[number].label}, ${kinds[nodes[number].kind]}${nodes[number].latency ? ", " + nodes[number].latency : ""}`;
  const makeFocusable = (svgShape, name, act) => {
    svgShape.setAttribute("tabindex", "-1");
    svgShape.setAttribute("role", "button");
    svgShape.setAttribute("aria-label", name);
    svgShape.addEventListener("click", () => { if (moved <= 4) { act(); svgShape.focus?.({ preventScroll: true }); } });
    svgShape.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } });
    svgShape.addEventListener("focus", () => { stage.querySelectorAll('[tabindex="0"]').forEach((old) => old.setAttribute("tabindex", "-1")); svgShape.setAttribute("tabindex", "0"); });
  };
  for (const [number, svgShape] of picture.nodes) makeFocusable(svgShape, label(number), () => choose(number));
  for (const [key, svgShape] of picture.boxes ?? []) {
    makeFocusable(svgShape, `${boxes.get(key).label}, ${nodeCountText(boxes.get(key).members)}`, () => chooseBox(key));
    svgShape.addEventListener("dblclick", () => openBox(key));
  }
  const first = [...(picture.boxes ?? picture.nodes).values()].find((svgShape) => !svgShape.classList.contains("gone"));
  first?.setAttribute("tabindex", "0");
}

function mark() {
  const related = state.node === null ? null : new Set([...reach([state.node], needs, Infinity), ...reach([state.node], neededBy, Infinity)]);
  const back = state.node === null ? null : reach([state.node], needs, Infinity), ahead = state.node === null ? null : reach([state.node], neededBy, Infinity);
  for (const [number, svgShape] of picture.nodes) {
    svgShape.classList.toggle("away", related !== null && !related.has(number));
    svgShape.classList.toggle("chosen", number === state.node);
  }
  for (const [number, svgShape] of picture.edges) {
    const [from, to] = edges[number];
    svgShape.classList.toggle("away", related !== null && !((back.has(from) && back.has(to)) || (ahead.has(from) && ahead.has(to))));
  }
  for (const [key, svgShape] of picture.boxes ?? []) svgShape.classList.toggle("chosen", key === state.box);
}

function choose(number) {
  state.node = number;
  state.box = null;
  if (number !== null && state.hidden.delete(nodes[number].kind)) legend();
  history.replaceState(null, "", number === null ? "#" : "#" + encodeURIComponent(nodes[number].id));
  if (state.view === "overview" && number !== null) state.view = "part";
  if (state.view === "part") { if (number === null && !state.members) state.view = home(); show(); }
  else { if (number !== null && !picture.nodes.get(number)?.isConnected) show({ refit: false }); mark(); controls(); updatePanel(); if (fitted) fit(); }
  bringIn(picture.nodes.get(number));
}

function bringIn(svgShape) {
  if (!svgShape) return;
  const frame = stage.getBoundingClientRect(), box = svgShape.getBoundingClientRect();
  const shift = (low, high, least, most) => (low < least + 8 ? least + 8 - low : high > most - 8 ? most - 8 - high : 0);
  view.x += shift(box.left, box.right, frame.left, frame.right);
  view.y += shift(box.top, box.bottom, frame.top, frame.bottom);
  place();
}

function reveal(number) {
  if (nodes.length > LARGE) state.view = "part"; // in the complete graph its neighbours may be far away
  choose(number);
  picture.nodes.get(number)?.focus({ preventScroll: true });
}

function chooseBox(key) { state.box = key; state.node = null; mark(); controls(); updatePanel(); }
function openBox(key) { state.members = boxes.get(key).members; state.box = key; state.node = null; state.view = "part"; show(); }
const home = () => (boxes.size ? "overview" : "whole");

function go(name) {
  state.view = name;
  if (name !== "part") state.members = null;
  if (name === "overview") state.node = null;
  show();
  if (name === "whole") bringIn(picture.nodes.get(state.node));
}

function controls() {
  const names = { overview: `Overview (${boxes.size})`, whole: `All (${nodes.length})`, part: state.node === null && (state.box || state.members) ? "Around the chosen group" : "Around the chosen node" };
  const able = { overview: boxes.size > 0, whole: true, part: state.node !== null || state.members !== null || state.box !== null };
  const focused = document.activeElement?.name === "view";
  find("views").replaceChildren(...Object.entries(names).map(([name, label]) => element("label", {},
    element("input", { type: "radio", name: "view", value: name, checked: state.view === name, disabled: !able[name], onchange: () => name === "part" && state.node === null && state.box ? openBox(state.box) : go(name) }), label)));
  if (focused) find("views").querySelector("input:checked")?.focus();
  find("steps-label").hidden = !(state.view === "part" && state.node !== null);
}

// ---- the panel

const goTo = (number) => element("li", {}, element("button", { type: "button", onclick: () => reveal(number) }, element("span", { class: `dot ${nodes[number].kind}` }), nodes[number].label));

function listSection(title, numbers) {
  if (!numbers.length) return [];
  return [element("h3", {}, `${title} (${numbers.length})`), element("ul", {}, ...numbers.map(goTo))];
}

function facts(pairs) {
  return element("dl", {}, ...pairs.filter(([, value]) => value !== undefined && value !== null && value !== "").flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, String(value))]));
}

function updatePanel() {
  const panel = find("panel");
  const hidden = state.node === null && state.box === null && !state.help;
  if (panel.hidden !== hidden) {
    panel.hidden = hidden;
    if (fitted && picture) fit();
  }
  find("help").setAttribute("aria-pressed", String(state.help));
  if (state.node !== null) panel.replaceChildren(...aboutNode(state.node));
  else if (state.box !== null) panel.replaceChildren(...aboutBox(boxes.get(state.box)));
  else panel.replaceChildren(...help());
  panel.scrollTop = 0;
}

function aboutNode(number) {
  const node = nodes[number];
  const known = node.kind === "given" ? "when an agent or the main execution sets it" : node.worst_case_s === null ? "" : `at the latest ${Number(node.worst_case_s.toFixed(3))} s after it is declared`;
  const direct = (list) => [...new Set(list.map(([other]) => other))];
  const before = [...reach([number], needs, Infinity)].length - 1, after = [...reach([number], neededBy, Infinity)].length - 1;
  return [
    element("h2", {}, node.label),
    element("small", {}, `${kinds[node.kind]}`),
    node.description ? element("p", {}, node.description) : "",
    facts([["Name", node.name], ["Place", node.place], ["Known", known], ...Object.entries(node.facts), ["In all", `needs ${before}, is needed by ${after}`]]),
    element("button", { type: "button", onclick: () => go(state.view === "part" ? home() : "part") }, state.view === "part" ? "Back" : "Show only its neighbourhood"),
    " ", element("button", { type: "button", onclick: () => choose(null) }, "Deselect"),
    ...listSection("Needs", direct(needs[number])),
    ...listSection("Is needed by", direct(neededBy[number])),
  ];
}

function aboutBox(box) {
  const by = (kind) => box.members.filter((number) => nodes[number].kind === kind);
  return [
    element("h2", {}, box.label),
    element("small", {}, nodeCountText(box.members)),
    state.view === "part" ? "" : element("p", {}, element("button", { type: "button", onclick: () => openBox(box.key) }, "Show its contents")),
    ...Object.keys(kinds).flatMap((kind) => listSection(kinds[kind], by(kind))),
  ];
}

function help() {
  const by = (kind) => [...nodes.keys()].filter((number) => nodes[number].kind === kind);
  return [
    element("h2", {}, data.title),
    element("p", {}, Object.keys(kinds).map((kind) => `${by(kind).length} × ${kinds[kind]}`).join(", ") + "."),
    element("p", {}, "Arrows lead from a node to the nodes that need it. Choose a node to see everything that it needs and everything that needs it."),
    boxes.size ? element("p", {}, "In the overview, a double frame represents several nodes: choose it to see them.") : "",
    element("p", {}, element("small", {}, "Drag to move, wheel to zoom. Keys: / search, arrows walk from node to node, Enter chooses, Escape deselects, + − 0 zoom.")),
    ...listSection("Start from a skill", by("skill")),
  ];
}

// ---- legend and filter

function legend() {
  const toggles = Object.keys(kinds).map((kind) => element("label", { title: "Show or hide" },
    element("input", { type: "checkbox", checked: !state.hidden.has(kind), onchange: (event) => { state.hidden[event.target.checked ? "delete" : "add"](kind); if (state.node !== null && state.hidden.has(nodes[state.node].kind)) state.node = null; show({ refit: false }); } }),
    element("span", { class: `swatch ${kind}` }), kinds[kind]));
  const samples = Object.entries(arrows).map(([kind, sentence]) => {
    const text = (x, letter) => { const newElement = shape("text", { x, y: 13 }); newElement.textContent = letter; return newElement; };
    const arrow = shape("g", { class: `edge ${kind}` }, shape("path", { d: "M14,9H43" }), shape("polygon", { points: "43,5.5 50,9 43,12.5" }));
    return element("label", {}, shape("svg", { "aria-hidden": "true" }, text(2, "A"), arrow, text(54, "B")), sentence);
  });
  const bound = latency ? [element("label", {}, "≤ 1 s", element("small", {}, latency))] : [];
  find("legend").replaceChildren(...toggles, ...samples, ...bound);
}

// ---- search

let hits = [], selectedIndex = 0;

function search() {
  const query = find("search").value;
  hits = matchingNodes(nodes, query);
  selectedIndex = 0;
  drawHits(query.trim() !== "");
}

function drawHits(open) {
  const list = find("hits");
  list.hidden = !open;
  find("search").setAttribute("aria-expanded", String(open));
  const shown = hits.slice(0, 60).map((number, index) => element("li", { role: "option", id: `hit${index}`, "aria-selected": String(index === selectedIndex), onpointerdown: (event) => { event.preventDefault(); take(index); } },
    element("span", { class: `dot ${nodes[number].kind}` }), nodes[number].label, " ", element("small", {}, nodes[number].place)));
  const rest = hits.length > 60 ? [element("li", { "aria-disabled": "true" }, `and ${hits.length - 60} more`)] : [];
  list.replaceChildren(...shown, ...rest, ...(open && !hits.length ? [element("li", { "aria-disabled": "true" }, "no match")] : []));
  if (open && hits.length) find("search").setAttribute("aria-activedescendant", `hit${selectedIndex}`); else find("search").removeAttribute("aria-activedescendant");
  list.children[selectedIndex]?.scrollIntoView({ block: "nearest" });
}

function take(index) {
  if (hits[index] === undefined) return;
  const number = hits[index];
  drawHits(false);
  reveal(number);
}

find("search").addEventListener("input", search);
find("search").addEventListener("focus", () => find("search").value && search());
find("search").addEventListener("blur", () => drawHits(false));
find("search").addEventListener("keydown", (event) => {
  const last = Math.min(hits.length, 60) - 1;
  if (event.key === "ArrowDown") selectedIndex = Math.min(last, selectedIndex + 1);
  else if (event.key === "ArrowUp") selectedIndex = Math.max(0, selectedIndex - 1);
  else if (event.key === "Enter") { event.preventDefault(); take(selectedIndex); return; }
  else if (event.key === "Escape") { event.stopPropagation(); find("search").value = ""; search(); find("search").blur(); return; }
  else return;
  event.preventDefault();
  drawHits(true);
});

// ---- keys

function walk(key) {
  const focused = [...picture.nodes].find(([, svgShape]) => svgShape === document.activeElement);
  const focusedBox = [...(picture.boxes ?? [])].find(([, svgShape]) => svgShape === document.activeElement);
  if (!focused && !focusedBox) return false;
  const here = (focused ?? focusedBox)[1].getBoundingClientRect();
  const candidates = picture.boxes ? [...picture.boxes.values(), ...picture.nodes.values()] : key === "ArrowLeft" || key === "ArrowRight"
    ? (key === "ArrowLeft" ? needs : neededBy)[focused[0]].map(([other]) => picture.nodes.get(other)).filter(Boolean) : [...picture.nodes.values()];
  const middle = (box) => [box.left + box.width / 2, box.top + box.height / 2];
  const [x, y] = middle(here);
  const sideways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
  let best = null, least = Infinity;
  for (const svgShape of candidates) {
    if (svgShape === (focused ?? focusedBox)[1] || svgShape.classList.contains("gone")) continue;
    const [otherX, otherY] = middle(svgShape.getBoundingClientRect());
    const along = (otherX - x) * sideways[0] + (otherY - y) * sideways[1];
    const across = Math.abs((otherX - x) * sideways[1]) + Math.abs((otherY - y) * sideways[0]);
    const cost = along > 1 ? along + 3 * across : focused && (key === "ArrowLeft" || key === "ArrowRight") ? 1e6 + across : Infinity;
    if (cost < least) { least = cost; best = svgShape; }
  }
  if (!best) return true;
  best.focus({ preventScroll: true });
  bringIn(best);
  return true;
}

window.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target.matches?.("input, select");
  if (event.key === "Escape") { if (state.node !== null) choose(null); else if (state.view !== home()) go(home()); else { state.box = null; mark(); updatePanel(); } return; }
  if (typing) return;
  if (event.key === "/") { event.preventDefault(); find("search").focus(); find("search").select(); }
  else if (event.key === "+" || event.key === "=") zoom(1.25);
  else if (event.key === "-") zoom(0.8);
  else if (event.key === "0") fit(0);
  else if (event.key.startsWith("Arrow") && walk(event.key)) event.preventDefault();
});

find("zoom-in").addEventListener("click", () => zoom(1.25));
find("zoom-out").addEventListener("click", () => zoom(0.8));
find("fit").addEventListener("click", () => fit(0));
find("help").addEventListener("click", () => { state.help = !state.help; updatePanel(); });
find("steps").value = nodes.length > LARGE ? "3" : "99999";
find("steps").addEventListener("change", () => show());
find("views").addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("resize", () => { if (fitted) fit(); });
matchMedia("print").addEventListener("change", (event) => fit(event.matches ? 0 : undefined)); // a sheet of paper shows all

legend();
show();
const linkedNode = nodes.findIndex((node) => "#" + encodeURIComponent(node.id) === location.hash || "#" + node.id === location.hash);
if (linkedNode >= 0) reveal(linkedNode);
