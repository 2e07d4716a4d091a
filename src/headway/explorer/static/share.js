// What can be taken away: the address, files, and a picture of all charts.

import { colours } from "./theme.js";

export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = Object.assign(document.createElement("a"), { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

// A file that the server makes of the state; throws with its sentence.
export async function take(form, state) {
  const answer = await fetch(`export/${form}`, { method: "POST", body: JSON.stringify(state) });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  save(await answer.blob(), `headway-explorer.${form}`);
}

// All charts on one canvas; `cards` are [title, canvas or image, aspect], `words` the verdict.
export async function picture(cards, words) {
  const width = 1600, gap = 24, half = (width - 3 * gap) / 2, tall = 330, title = 30;
  const rows = Math.ceil((cards.length - 1) / 2);
  const canvas = Object.assign(document.createElement("canvas"), { width, height: 150 + words.length * 26 + rows * (tall + title + gap) + 2 * gap });
  const pen = canvas.getContext("2d"), c = colours();
  pen.fillStyle = c.card;
  pen.fillRect(0, 0, width, canvas.height);
  pen.fillStyle = c.ink;
  pen.font = "600 22px system-ui, sans-serif";
  let y = gap + 20;
  for (const sentence of words) {
    pen.fillText(sentence, gap, y, width - 2 * gap);
    pen.font = "18px system-ui, sans-serif";
    y += 26;
  }
  const put = ([name, image], x, top, w, h) => {
    pen.fillStyle = c.ink;
    pen.font = "600 17px system-ui, sans-serif";
    if (name) pen.fillText(name, x, top + 18);
    const scale = Math.min(w / image.width, h / image.height);
    pen.drawImage(image, x, top + title, image.width * scale, image.height * scale);
  };
  put(cards[0], gap, y, width - 2 * gap, 90);
  y += 90 + title + 10;
  cards.slice(1).forEach((card, i) => put(card, gap + (i % 2) * (half + gap), y + Math.floor(i / 2) * (tall + title + gap), half, tall));
  save(await new Promise((done) => canvas.toBlob(done, "image/png")), "headway-explorer.png");
}
