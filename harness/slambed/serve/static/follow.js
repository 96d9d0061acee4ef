// SPDX-License-Identifier: Apache-2.0
// Keeps a page up to date while campaigns run, and applies filters without a button.
"use strict";

(() => {
  const every_ms = 2000;
  const state = () => document.querySelector("main").dataset;
  const says = document.getElementById("follows");

  async function renew(address) {
    const answer = await fetch(address, { headers: { Accept: "text/html" } });
    if (!answer.ok) throw new Error(String(answer.status));
    const fresh = new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("main");
    const focused = document.activeElement && document.activeElement.id;
    const open = [...document.querySelectorAll("main details[open][id]")].map((item) => item.id);
    document.querySelector("main").replaceWith(document.adoptNode(fresh));
    for (const id of open) { const item = document.getElementById(id); if (item) item.open = true; }
    if (focused && document.getElementById(focused)) document.getElementById(focused).focus();
    document.dispatchEvent(new Event("renewed"));
  }

  async function look() {
    try {
      if (!document.hidden && state().version) {
        const answer = await fetch(state().state, { cache: "no-store" });
        const { version } = await answer.json();
        if (version !== state().version) await renew(location.href);
        if (says) says.textContent = "";
      }
    } catch {
      if (says) says.textContent = "slambed serve has ended; this is what it last showed.";
    }
    setTimeout(look, every_ms);
  }

  document.addEventListener("change", (event) => {
    const form = event.target.form;
    if (!form || !form.classList.contains("filters")) return;
    const asked = new URLSearchParams([...new FormData(form)].filter(([, value]) => value !== ""));
    const address = `${location.pathname}${asked.size ? `?${asked}` : ""}`;
    history.pushState(null, "", address);
    renew(address).catch(() => location.assign(address));
  });
  addEventListener("popstate", () => renew(location.href).catch(() => location.reload()));
  document.documentElement.classList.add("scripted");
  setTimeout(look, every_ms);
})();
