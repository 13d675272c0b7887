// The training of a run: curves and images, asked for again and again.
const kSeconds = 5, kWidth = 260, kHeight = 64;
const kSvg = 'http://www.w3.org/2000/svg';

function element(tag, text, ...children) {
  const made = document.createElement(tag);
  made.textContent = text;
  made.append(...children);
  return made;
}

// A curve of [step, value] pairs; values by their logarithm when all are positive.
function chart(points) {
  const positive = points.every(([, value]) => value > 0);
  const values = points.map(([, value]) => (positive ? Math.log(value) : value));
  const low = Math.min(...values), high = Math.max(...values), first = points[0][0], last = points.at(-1)[0];
  const svg = document.createElementNS(kSvg, 'svg'), line = document.createElementNS(kSvg, 'polyline');
  svg.setAttribute('viewBox', `0 0 ${kWidth} ${kHeight}`);
  line.setAttribute('points', points.map(([step], i) =>
    `${(kWidth * (step - first)) / Math.max(1, last - first)},${2 + (kHeight - 4) * (1 - (values[i] - low) / (high - low || 1))}`).join(' '));
  svg.append(line);
  return svg;
}

// @param enlarged names of images that a click has enlarged
function stageEntry(stage, s, addressOf, enlarged) {
  const entry = element('article', '', element('h3', `${stage.name}: step ${stage.steps}, ${Math.round(stage.seconds)} s`));
  for (const [name, points] of Object.entries(stage.curves))
    entry.append(element('p', `${name} ${points.at(-1)[1].toPrecision(4)}`), chart(points));
  stage.images.forEach(({ caption, written }, i) => {
    const image = document.createElement('img');
    image.src = addressOf({ stage: s, image: i, written });
    image.alt = caption;
    const name = `${stage.name} ${caption}`;
    image.classList.toggle('large', enlarged.has(name));
    image.addEventListener('click', () => { if (image.classList.toggle('large')) enlarged.add(name); else enlarged.delete(name); });
    entry.append(image, element('p', caption));
  });
  return entry;
}

// Calls `ask`, the state of the training, and shows it in `place` when it has changed.
// @param addressOf the address of an image, given stage, image and when it was written  @param failed takes errors
export async function followTraining(ask, addressOf, place, failed) {
  let shown = '';
  const enlarged = new Set();
  for (;;) {
    try {
      const state = document.hidden ? null : await ask(), text = JSON.stringify(state);
      if (state && text !== shown) {
        shown = text;
        place.replaceChildren(...state.stages.map((stage, s) => stageEntry(stage, s, addressOf, enlarged)));
        if (!state.stages.length) place.textContent = 'No step was logged yet.';
      }
    } catch (error) { failed(error); }
    await new Promise((done) => { setTimeout(done, 1000 * kSeconds); });
  }
}
