"use strict";
// Pure functions about graphs, without access to the document.

function neighboursOf(count, edges) {
  // The neighbours of each node in both directions, as [node, kind of edge, number of the edge].
  const needs = Array.from({ length: count }, () => []), neededBy = Array.from({ length: count }, () => []);
  edges.forEach(([need, user, kind], number) => {
    needs[user].push([need, kind, number]);
    neededBy[need].push([user, kind, number]);
  });
  return { needs, neededBy };
}

function reach(start, neighbours, steps) {
  const reached = new Set(start);
  let edge = [...start];
  while (edge.length && steps-- > 0) {
    const next = [];
    for (const one of edge) for (const [other] of neighbours[one]) if (!reached.has(other)) { reached.add(other); next.push(other); }
    edge = next;
  }
  return reached;
}

function linksBetween(boxes, edges) {
  // One link for all edges between two boxes; if there are edges in both directions, the link has two heads.
  const boxOf = new Map(boxes.flatMap((box, index) => box.members.map((number) => [number, index])));
  const links = new Map();
  for (const [need, user] of edges) {
    const from = boxOf.get(need), to = boxOf.get(user);
    if (from === to || links.has(`${from} ${to}`)) continue;
    const opposite = links.get(`${to} ${from}`);
    if (opposite) opposite[2] = "several both";
    else links.set(`${from} ${to}`, [from, to, "several"]);
  }
  return [...links.values()];
}

function matchingNodes(nodes, query) {
  // The nodes that match every word of the query. Nodes come first if their label begins with the first word, then if it contains this word.
  const fold = (text) => text.toLowerCase();
  const words = fold(query).split(/\s+/).filter(Boolean);
  const searchText = (node) => fold([node.label, node.name, node.id, node.place, node.description, ...Object.values(node.facts)].join("\n"));
  const hits = words.length ? [...nodes.keys()].filter((number) => words.every((word) => searchText(nodes[number]).includes(word))) : [];
  const rank = (number) => (fold(nodes[number].label).startsWith(words[0]) ? 0 : fold(nodes[number].label).includes(words[0]) ? 1 : 2);
  return hits.sort((one, other) => rank(one) - rank(other) || one - other);
}

// ---- layout in columns: a needed node is left of the nodes that need it

function columnsOf(count, links) {
  const out = Array.from({ length: count }, () => []);
  const into = Array.from({ length: count }, () => []);
  for (const [from, to] of links) if (from !== to) { out[from].push(to); into[to].push(from); }
  const seen = new Uint8Array(count), order = [];
  for (let root = count - 1; root >= 0; root--) {
    if (seen[root]) continue;
    const stack = [[root, out[root].length]];
    seen[root] = 1;
    while (stack.length) {
      const top = stack[stack.length - 1];
      if (top[1] > 0) {
        const next = out[top[0]][--top[1]];
        if (!seen[next]) { seen[next] = 1; stack.push([next, out[next].length]); }
      } else { order.push(top[0]); stack.pop(); }
    }
  }
  order.reverse();
  const place = new Int32Array(count);
  order.forEach((number, index) => (place[number] = index));
  const forward = (from, to) => place[from] < place[to]; // the others close a cycle
  const rank = new Int32Array(count);
  for (const from of order) for (const to of out[from]) if (forward(from, to)) rank[to] = Math.max(rank[to], rank[from] + 1);
  for (const number of order) {
    const later = out[number].filter((to) => forward(number, to)).map((to) => rank[to]);
    if (!into[number].length && later.length) rank[number] = Math.min(...later) - 1;
  }
  return { rank, out, into, order };
}

function isotonic(wanted, sizes, gap) {
  // Places nodes in order and without overlap, as near as possible to their preferred places. Nodes that would collide form a group.
  const pools = [];
  let offset = 0;
  const offsets = wanted.map((_, index) => { const at = offset + sizes[index] / 2; offset += sizes[index] + gap; return at; });
  wanted.forEach((at, index) => {
    pools.push({ sum: at - offsets[index], count: 1 });
    while (pools.length > 1 && pools[pools.length - 2].sum / pools[pools.length - 2].count > pools[pools.length - 1].sum / pools[pools.length - 1].count) {
      const last = pools.pop();
      pools[pools.length - 1].sum += last.sum;
      pools[pools.length - 1].count += last.count;
    }
  });
  const placed = [];
  for (const pool of pools) for (let i = 0; i < pool.count; i++) placed.push(pool.sum / pool.count + offsets[placed.length]);
  return placed;
}

const TALL = 20; // a column with more nodes than this is split into several columns

const MAX_BENDS = 4000;

function bendLinks(items, links, rank) {
  // A link over several columns has a bend in each column. The bend gets space there, so that the link passes between the nodes.
  const all = [...items], ranks = [...rank], ways = [], parts = [];
  const wide = new Set();
  const heights = new Map();
  rank.forEach((column) => heights.set(column, (heights.get(column) ?? 0) + 1));
  for (const [column, count] of heights) if (count > TALL) wide.add(column);
  for (const [from, to] of links) {
    const way = [from];
    if (all.length - items.length < MAX_BENDS) {
      for (let column = rank[from] + 1; column < rank[to]; column++) {
        if (wide.has(column)) continue;
        way.push(all.length);
        all.push({ width: 0, height: 8 });
        ranks.push(column);
      }
    }
    way.push(to);
    ways.push(way);
    way.slice(1).forEach((end, index) => parts.push([way[index], end]));
  }
  return { all, ranks, ways, parts };
}

function layOut(nodesOnly, linksOnly) {
  const first = columnsOf(nodesOnly.length, linksOnly);
  const { all: items, ranks: rank, ways, parts: links } = bendLinks(nodesOnly, linksOnly, first.rank);
  const { out, into, order } = columnsOf(items.length, links);
  const columns = [];
  for (const number of order) (columns[rank[number]] ??= []).push(number);
  const filled = columns.filter(Boolean);
  const row = new Float64Array(items.length);
  filled.forEach((column) => column.forEach((number, index) => (row[number] = index)));
  const mean = (list) => list.reduce((sum, other) => sum + row[other], 0) / list.length;
  for (let sweep = 0; sweep < 12; sweep++) {
    const forward = sweep % 2 === 0;
    for (const column of forward ? filled : [...filled].reverse()) {
      const aim = new Map(column.map((number, index) => {
        const list = forward ? into[number] : out[number];
        return [number, list.length ? mean(list) : row[number] ?? index];
      }));
      column.sort((one, other) => aim.get(one) - aim.get(other));
      column.forEach((number, index) => (row[number] = index * (100 / column.length)));
    }
  }
  const gap = 14;
  const y = new Float64Array(items.length), x = new Float64Array(items.length);
  for (const column of filled) {
    const parts = Math.ceil(column.length / TALL);
    const tallest = Math.max(...column.map((number) => items[number].height));
    let offset = 0;
    column.forEach((number, index) => {
      if (parts > 1) { y[number] = Math.floor(index / parts) * (tallest + gap); return; }
      y[number] = offset + items[number].height / 2;
      offset += items[number].height + gap;
    });
  }
  for (let sweep = 0; sweep < 10; sweep++) {
    for (const column of sweep % 2 ? [...filled].reverse() : filled) {
      if (column.length > TALL) continue;
      const wanted = column.map((number) => {
        const near = [...into[number], ...out[number]];
        return near.length ? near.reduce((sum, other) => sum + y[other], 0) / near.length : y[number];
      });
      isotonic(wanted, column.map((number) => items[number].height), gap).forEach((at, index) => (y[column[index]] = at));
    }
  }
  let left = 0;
  for (const column of filled) {
    const parts = Math.ceil(column.length / TALL);
    const width = Math.max(...column.map((number) => items[number].width));
    column.forEach((number, index) => (x[number] = left + width / 2 + (index % parts) * (width + 24)));
    left += parts * (width + 24) - 24 + Math.min(160, 70 + 4 * column.length);
  }
  const at = items.map((_, number) => ({ x: x[number], y: y[number] }));
  return { at, ways: ways.map((way) => way.slice(1, -1).map((bend) => at[bend])) };
}
