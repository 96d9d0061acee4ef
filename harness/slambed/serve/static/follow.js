// SPDX-License-Identifier: Apache-2.0
// Keeps a page up to date while campaigns run, and applies filters without a button.
"use strict";

(() => {
  const every_ms = 2000;
  const state = () => document.querySelector("main").dataset;
  const says = document.getElementById("follows");

  let renewals = 0;

  // Returns the text at an address, or throws what the page then says.
  async function textOf(address, options) {
    let answer, text;
    try {
      answer = await fetch(address, options);
      text = await answer.text();
    } catch {
      throw new Error("slambed serve has ended");
    }
    if (!answer.ok) throw new Error(`slambed serve answers with status ${answer.status}`);
    return text;
  }

  // Shows the page of an address, unless a later renewal began meanwhile.
  async function renew(address) {
    const own = ++renewals;
    const text = await textOf(address, { headers: { Accept: "text/html" } }).catch((error) => {
      if (own === renewals) throw error;
    });
    if (own !== renewals) return;
    const fresh = new DOMParser().parseFromString(text, "text/html").querySelector("main");
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
        const { version } = JSON.parse(await textOf(state().state, { cache: "no-store" }));
        if (version !== state().version) await renew(location.href);
        if (says) says.textContent = "";
      }
    } catch (error) {
      if (says) says.textContent = `${error.message}; this is what it last showed.`;
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
