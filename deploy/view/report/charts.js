// Draws each .chart of the page with uPlot: hover shows the values, dragging zooms, a double click zooms out.
(function () {
  "use strict";
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const wide = (box) => Math.max(260, box.clientWidth - (box.clientWidth > 700 ? 220 : 0));
  const plots = [];

  function marks(list) {
    return (u) => {
      const c = u.ctx, top = u.bbox.top, size = 10 * devicePixelRatio;
      c.save();
      c.strokeStyle = c.fillStyle = css("--soft");
      c.font = size + "px system-ui, sans-serif";
      c.setLineDash([4, 4]);
      c.textAlign = "left";
      const seen = list.map((m) => [u.valToPos(m.t, "x", true), m.text])
        .filter(([x]) => x >= u.bbox.left && x <= u.bbox.left + u.bbox.width);
      const texts = [];
      let last = -Infinity, row = 0;
      for (const [x, text] of seen) {
        row = x < last ? row + 1 : 0;
        const width = c.measureText(text).width, right = x + width + 6 > u.bbox.left + u.bbox.width;
        const from = right ? x - width - 3 : x + 3, base = top + size * (1.1 + 1.2 * row);
        c.fillText(text, from, base);
        texts.push({ from, to: from + width, over: base - size, under: base + 0.3 * size });
        last = x + width + 12;
      }
      for (const [x] of seen) {  // a line stops where a text is
        const crossed = texts.filter((t) => t.from < x && x < t.to).sort((a, b) => a.over - b.over);
        c.beginPath();
        c.moveTo(x, top);
        for (const t of crossed) { c.lineTo(x, t.over); c.moveTo(x, t.under); }
        c.lineTo(x, top + u.bbox.height);
        c.stroke();
      }
      c.restore();
    };
  }

  function draw(box) {
    const d = JSON.parse(box.querySelector("script").textContent);
    const axis = { stroke: () => css("--ink"), grid: { stroke: () => css("--line"), width: 1 }, ticks: { stroke: () => css("--line") } };
    const u = new uPlot({
      title: d.title, width: wide(box), height: 300,
      scales: { x: { time: false } },
      cursor: { sync: { key: "lfa" }, drag: { x: true, y: false } },
      axes: [{ ...axis, label: "time [s]" }, { ...axis, label: "[" + d.unit + "]", size: 64 }],
      series: [{ label: "time [s]", value: (_, v) => (v == null ? "–" : v.toFixed(2)) },
        ...d.series.map((s) => ({ label: s.name, stroke: s.colour, width: 1.5, points: { show: false }, spanGaps: false,
          value: (_, v) => (v == null ? "–" : v.toPrecision(3)) }))],
      hooks: { draw: [marks(d.marks)] },
    }, [d.t, ...d.series.map((s) => s.y)], box);
    plots.push([u, box]);
    const bar = document.createElement("p");
    bar.className = "soft small";
    bar.append("Drag to zoom, double click for all. ", link("CSV", () => [csv(d), d.title + ".csv", "text/csv"]));
    box.append(bar);
  }

  function csv(d) {
    const rows = [["time_s", ...d.series.map((s) => (s.name + " [" + d.unit + "]").replace(/,/g, ""))]];
    d.t.forEach((t, n) => rows.push([t, ...d.series.map((s) => (s.y[n] == null ? "" : s.y[n]))]));
    return rows.map((r) => r.join(",")).join("\n") + "\n";
  }

  function link(text, make) {
    const a = document.createElement("a");
    a.textContent = text;
    a.href = "#";
    a.onclick = (event) => {
      event.preventDefault();
      const [data, name, type] = make(), save = document.createElement("a");
      save.href = URL.createObjectURL(new Blob([data], { type }));
      save.download = name.replace(/[^\w.-]+/g, "_");
      save.click();
      setTimeout(() => URL.revokeObjectURL(save.href), 1000);
    };
    return a;
  }

  document.documentElement.classList.add("scripted");
  document.querySelectorAll(".chart").forEach(draw);
  document.querySelectorAll("figure img").forEach((img) => {
    const caption = document.createElement("figcaption");
    caption.append(link("SVG", () => [Uint8Array.from(atob(img.src.split(",")[1]), (c) => c.charCodeAt(0)), img.alt + ".svg", "image/svg+xml"]));
    img.parentElement.append(caption);
  });
  const again = () => plots.forEach(([u, box]) => u.setSize({ width: wide(box), height: 300 }));
  addEventListener("resize", again);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach(([u]) => u.redraw()));
})();
