(function () {
  // Rotors: grids of 16-bit points, lit and turned by WebGL; without it the still picture stays.
  const VERTEX = "#version 300 es\nin vec3 p; in vec3 n; uniform mat4 view; uniform mat3 turn; out vec3 normal;" +
    "void main() { normal = turn * n; gl_Position = view * vec4(p, 1.0); }";
  const FRAGMENT = "#version 300 es\nprecision mediump float; in vec3 normal; uniform vec3 colour; out vec4 paint;" +
    "void main() { float l = abs(dot(normalize(normal), vec3(0.34, 0.44, 0.83)));" +
    "paint = vec4(colour * (0.38 + 0.62 * l), 1.0); }";
  const CREASE = 0.8; // cosine above which neighbouring facets share a normal
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  function facets(mesh) {
    const raw = Uint8Array.from(atob(mesh.data), (c) => c.charCodeAt(0)), p = new Int16Array(raw.buffer);
    const at = (i, j) => { const k = 3 * (i * mesh.columns + j); return [p[k] / 32767, p[k + 1] / 32767, p[k + 2] / 32767]; };
    const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    const unit = (v) => { const s = Math.hypot(...v) || 1; return [v[0] / s, v[1] / s, v[2] / s]; };
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const quads = [], shared = new Map();
    for (let i = 0; i + 1 < mesh.rows; i++) {
      for (let j = 0; j + 1 < mesh.columns; j++) {
        const q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        const n = unit(cross(minus(q[2], q[0]), minus(q[3], q[1])));
        q.forEach((v) => { shared.set(v.join(), [...(shared.get(v.join()) || []), n]); });
        quads.push([q, n]);
      }
    }
    const out = [];
    quads.forEach(([q, n]) => {
      const normals = q.map((v) => {
        const near = shared.get(v.join()).filter((m) => m[0] * n[0] + m[1] * n[1] + m[2] * n[2] > CREASE);
        return unit(near.length ? near.reduce((s, m) => [s[0] + m[0], s[1] + m[1], s[2] + m[2]], [0, 0, 0]) : n);
      });
      [0, 1, 2, 0, 2, 3].forEach((k) => out.push(...q[k], ...normals[k]));
    });
    return new Float32Array(out);
  }

  function start(figure) {
    const canvas = figure.querySelector("canvas"), gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) { return; }
    const program = gl.createProgram();
    [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]].forEach(([kind, text]) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) { return; }
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    const place = (name) => gl.getUniformLocation(program, name);
    const parts = JSON.parse(canvas.getAttribute("data-mesh")).map((mesh) => {
      const data = facets(mesh), array = gl.createVertexArray();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      ["p", "n"].forEach((name, k) => {
        const slot = gl.getAttribLocation(program, name);
        gl.enableVertexAttribArray(slot);
        gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, 12 * k);
      });
      const colour = [1, 3, 5].map((k) => parseInt(mesh.colour.slice(k, k + 2), 16) / 255);
      return { array: array, count: data.length / 6, copies: mesh.copies, colour: colour };
    });
    const first = JSON.parse(canvas.getAttribute("data-view"));
    let yaw = first[0], pitch = first[1], zoom = 1, spinning = false, waiting = false;

    function draw() {
      waiting = false;
      const box = canvas.getBoundingClientRect(), ratio = Math.min(devicePixelRatio || 1, 2);
      canvas.width = Math.max(box.width * ratio, 1);
      canvas.height = Math.max(box.height * ratio, 1);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const sx = zoom * Math.min(0.95, first[2] * canvas.height / canvas.width), sy = sx * canvas.width / canvas.height;
      parts.forEach((part) => {
        gl.bindVertexArray(part.array);
        gl.uniform3fv(place("colour"), part.colour);
        for (let k = 0; k < part.copies; k++) {
          const a = yaw + 2 * Math.PI * k / part.copies;
          const c = Math.cos(a), s = Math.sin(a), u = Math.cos(pitch), v = Math.sin(pitch);
          const turn = [c, u * s, -v * s, -s, u * c, -v * c, 0, v, u]; // about the shaft, then tipped; by columns
          gl.uniformMatrix3fv(place("turn"), false, turn);
          gl.uniformMatrix4fv(place("view"), false, [
            sx * turn[0], sy * turn[1], -0.4 * turn[2], 0, sx * turn[3], sy * turn[4], -0.4 * turn[5], 0,
            sx * turn[6], sy * turn[7], -0.4 * turn[8], 0, 0, 0, 0, 1]);
          gl.drawArrays(gl.TRIANGLES, 0, part.count);
        }
      });
      if (spinning && figure.closest("section").classList.contains("shown")) { yaw += 0.02; later(); }
    }
    function later() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }
    function move(dyaw, dpitch, times) {
      yaw += dyaw;
      pitch = Math.max(-Math.PI, Math.min(Math.PI, pitch + dpitch));
      zoom = Math.max(0.5, Math.min(8, zoom * times));
      later();
    }
    const does = {
      spin: () => { if (still.matches) { move(0.26, 0, 1); } else { spinning = !spinning; later(); } },
      nearer: () => move(0, 0, 1.25),
      farther: () => move(0, 0, 0.8),
      reset: () => { spinning = false; yaw = first[0]; pitch = first[1]; zoom = 1; later(); },
    };
    const keys = {
      ArrowLeft: () => move(-0.1, 0, 1), ArrowRight: () => move(0.1, 0, 1), ArrowUp: () => move(0, -0.1, 1),
      ArrowDown: () => move(0, 0.1, 1), "+": does.nearer, "-": does.farther, " ": does.spin, Home: does.reset,
    };
    canvas.addEventListener("keydown", (event) => {
      if (keys[event.key]) { keys[event.key](); event.preventDefault(); }
    });
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const old = fingers.get(event.pointerId);
      if (!old) { return; }
      const now = [event.clientX, event.clientY], other = Array.from(fingers).find(([id]) => id !== event.pointerId);
      if (other) {
        const far = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]) || 1;
        move(0, 0, far(now) / far(old));
      } else { move(0.01 * (now[0] - old[0]), 0.01 * (now[1] - old[1]), 1); }
      fingers.set(event.pointerId, now);
    });
    ["pointerup", "pointercancel"].forEach((name) => canvas.addEventListener(name, (event) => fingers.delete(event.pointerId)));
    figure.querySelectorAll("button[data-do]").forEach((b) => b.addEventListener("click", does[b.getAttribute("data-do")]));
    window.addEventListener("resize", later);
    figure.classList.add("turning");
    draw();
  }

  document.querySelectorAll("figure.rotor").forEach((figure) => {
    figure.closest("section").addEventListener("shown", () => start(figure), { once: true });
  });
})();
