import './style.css';
import { open } from './source.js';
import { followLive } from './live.js';
import { reach } from './reach.js';
import { Picture } from './scene.js';
import { followTraining } from './training.js';

const element = (id) => document.getElementById(id);
const complain = (error) => { element('message').textContent = String(error.message ?? error); element('message').hidden = false; };

// Whether a network makes the stage's texture or its Gaussians for one camera.
const seesCamera = ({ texture_size, gaussians }) => texture_size > 0 || gaussians > 0;

// One request at a time; of those that come meanwhile, the newest is kept.
function newestOnly(work) {
  let busy = false, waiting = null;
  async function ask(...args) {
    if (busy) { waiting = args; return; }
    busy = true;
    try { await work(...args); element('message').hidden = true; } catch (error) { complain(error); }
    busy = false;
    if (waiting) { const next = waiting; waiting = null; ask(...next); }
  }
  return Object.assign(ask, { idle: () => !busy });
}

function app(source) {
  const { about } = source, picture = new Picture(element('stage'), source);
  const state = { frame: 0, playing: false, edited: null, stage: about.stages.findLast((stage) => !seesCamera(stage)), speed: 1 };
  const dofs = () => state.edited ?? source.dofsOf(state.frame);
  const stagesInView = () => (state.beside ? about.stages : [state.stage]);

  async function drawDouble() {
    const { frame, edited } = state, chosen = state.stage, stages = stagesInView();
    const surfaces = [];
    for (const [k, stage] of stages.entries()) {
      const projection = picture.projection(picture.asideOf(k, stages.indexOf(chosen)));
      const geometry = edited ? await source.pose(edited, stage, projection) : await source.frame(frame, stage, projection);
      surfaces.push({ stage, ...geometry });
    }
    state.geometry = surfaces.find(({ stage }) => stage === chosen);
    picture.show(surfaces, chosen, state.geometry.joints);
    return surfaces;
  }

  const draw = newestOnly(async () => {
    const { frame } = state;
    const surfaces = source.points ? [] : await drawDouble();
    if (source.points) picture.showPoints(source.points(frame));
    if (picture.through >= 0) await picture.project(source.picture(picture.through, frame, element('mask').checked));
    state.drawn = (state.drawn ?? 0) + 1;
    if (!state.framed) {
      state.framed = true;
      picture.frameAll();
      if (surfaces.some(({ stage }) => seesCamera(stage))) draw();  // now for this camera
    }
  });

  const sliders = about.dofs.map((dof, d) => {
    const row = document.createElement('label'), name = document.createElement('span');
    const slider = document.createElement('input'), value = document.createElement('output');
    const [low, high] = dof.limits ?? [-Math.PI, Math.PI];
    row.className = 'dof';
    name.textContent = name.title = dof.name;
    Object.assign(slider, { type: 'range', min: low, max: high, step: (high - low) / 500 });
    slider.dataset.dof = dof.name;
    slider.addEventListener('input', () => { const pose = dofs().slice(); pose[d] = Number(slider.value); edit(pose); });
    row.append(name, slider, value);
    element('dofs').append(row);
    return { row, slider, value };
  });

  function showNumbers() {
    dofs().forEach((value, d) => {
      sliders[d].slider.value = value;
      sliders[d].value.textContent = value.toFixed(2);
    });
    element('scrub').value = state.frame;
    element('frame').textContent = `${state.frame} / ${about.frames - 1}`;
    element('play').textContent = state.playing ? '❚❚' : '▶';
    element('follow').hidden = !state.edited;
    for (const button of element('stages').children) button.setAttribute('aria-checked', button.textContent === state.stage.name);
  }
  const update = () => { showNumbers(); draw(); };
  const edit = (pose) => { if (source.points) return; state.playing = false; state.edited = pose; update(); };
  const goTo = (frame) => { state.edited = null; state.frame = Math.max(0, Math.min(about.frames - 1, frame)); update(); };
  const play = (on) => { state.playing = on && about.frames > 1; if (on) state.edited = null; state.since = null; showNumbers(); };

  const drag = newestOnly(async (joint, target) => {
    state.reached = await reach(source, dofs(), joint, target);
    edit(state.reached.dofs);
  });
  picture.onDrag(drag);

  for (const stage of about.stages) {
    const button = document.createElement('button');
    button.textContent = stage.name;
    button.setAttribute('role', 'radio');
    button.addEventListener('click', () => { state.stage = stage; update(); });
    element('stages').append(button);
  }
  element('name').textContent = document.title = about.name;
  const showSizes = () => {
    const { cameras } = source.cameras, counts = source.points
      ? [`${cameras.length} cameras`, ...(about.points.length ? [`${about.points.length} points`] : [])]
      : [`${about.vertices} vertices`, `${about.dofs.length} DoFs`];
    element('facts').textContent = [...counts, `${about.frames} frames`].join(', ');
    element('scrub').max = about.frames - 1;
  };
  showSizes();
  element('scrub').addEventListener('input', ({ target }) => {
    const frame = Number(target.value);  // `play` shows the old one
    play(false);
    goTo(frame);
  });
  element('play').addEventListener('click', () => play(!state.playing));
  element('speed').addEventListener('change', (event) => { state.speed = Number(event.target.value); state.since = null; });
  element('light').addEventListener('input', (event) => picture.turnLight(Number(event.target.value)));
  element('texture').addEventListener('change', (event) => picture.useTexture(event.target.checked).catch(complain));
  element('beside').addEventListener('change', (event) => { Object.assign(state, { beside: event.target.checked, framed: false }); update(); });
  element('handles').addEventListener('change', (event) => picture.showHandles(event.target.checked));
  element('rest').addEventListener('click', () => edit(Float32Array.from(about.rest)));
  element('follow').addEventListener('click', () => goTo(state.frame));
  element('menu').addEventListener('click', () => element('panel').classList.toggle('hidden'));
  element('find').addEventListener('input', (event) => {
    const wanted = event.target.value.toLowerCase();
    about.dofs.forEach((dof, d) => { sliders[d].row.hidden = !dof.name.toLowerCase().includes(wanted); });
  });
  if (window.matchMedia('(max-width: 640px)').matches) element('panel').classList.add('hidden');
  picture.controls.addEventListener('end', () => { if (state.geometry && stagesInView().some(seesCamera)) draw(); });
  if (about.stages.length < 2) element('beside').parentElement.hidden = true;
  if (source.points) {
    document.body.classList.add('without-double');
    element('handles').parentElement.hidden = !about.points.length;
    element('handles').nextSibling.textContent = ' Points';
    element('stage').ariaLabel = 'What the cameras filmed. Drag to turn, scroll to zoom.';
  }
  if (!about.textured) element('texture').parentElement.hidden = true;

  // The cameras of the capture.
  const { cameras, masks } = source.cameras;
  const lookThrough = (index) => {
    if (!about.cameras) return;
    element('camera').value = index;
    if (state.framed) picture.lookThrough(index);
    draw();
  };
  for (const [index, { name }] of cameras.entries()) element('camera').append(new Option(name, index));
  element('cameras').hidden = !cameras.length;
  element('mask').parentElement.hidden = !masks;
  element('camera').addEventListener('change', (event) => lookThrough(Number(event.target.value)));
  element('mask').addEventListener('change', draw);
  element('opacity').addEventListener('input', (event) => picture.fade(Number(event.target.value)));
  picture.onCamera(lookThrough);
  if (source.training) {
    element('training').hidden = false;
    followTraining(source.training, source.trainingImage, element('progress'), complain);
  }

  // Somebody who is tracked now.
  const showLive = (latest) => {
    if (!latest && !state.live) return;
    state.live = latest;
    element('rate').textContent = latest
      ? `${latest.tracked ? 'live' : 'the person is lost'}, ${latest.rate.toFixed(1)} poses a second` : 'no poses come';
    if (!latest) return;
    element('mirror').hidden = false;
    picture.hidePicture();  // of a frame of the motion
    state.beside = element('beside').checked = false;
    Object.assign(state, { playing: false, edited: latest.dofs, geometry: latest.geometry });
    picture.show([{ stage: latest.stage, ...latest.geometry }], latest.stage, latest.geometry.joints);
    showNumbers();
  };
  const askLive = async (number) => {
    const { stage } = state, latest = await source.live(number, stage, picture.projection());
    return latest && { ...latest, stage };
  };
  if (source.live) followLive(askLive, showLive, () => element('live').checked && state.framed, complain);

  // A motion or a texture from the visitor's disk.
  const take = newestOnly(async (file) => {
    if (file.type.startsWith('image/')) {
      await picture.takeTexture(file);
      element('texture').checked = true;
      element('texture').parentElement.hidden = false;
    } else {
      play(false);
      await source.play(file);
      element('cameras').hidden = true;
      picture.hideCameras();
      showSizes();
      goTo(0);
    }
  });
  element('open').addEventListener('change', ({ target }) => {
    if (target.files[0]) take(target.files[0]);
    target.value = '';  // so that the same file can be opened again
  });
  window.addEventListener('dragover', (event) => event.preventDefault());
  window.addEventListener('drop', (event) => { event.preventDefault(); if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]); });

  window.addEventListener('keydown', (event) => {
    if (event.target.matches('input[type=search], select')) return;
    const actions = {
      ' ': () => play(!state.playing), ArrowLeft: () => goTo(state.frame - 1), ArrowRight: () => goTo(state.frame + 1),
      r: () => edit(Float32Array.from(about.rest)), c: () => lookThrough(picture.through + 1 < cameras.length ? picture.through + 1 : -1), h: () => element('panel').classList.toggle('hidden'),
    };
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches('input[type=range]') && event.key.startsWith('Arrow')) return;
    event.preventDefault();
    action();
  });

  requestAnimationFrame(function tick(now) {
    if (state.playing) {
      state.since ??= { now, frame: state.frame };
      const passed = ((now - state.since.now) / 1000) * about.frames_per_second * state.speed;
      const frame = (state.since.frame + Math.floor(passed)) % about.frames;
      if (frame !== state.frame) goTo(frame);
    }
    requestAnimationFrame(tick);
  });
  picture.useTexture(true).catch(complain);
  update();
  window.doppel = { state, picture, source, goTo, edit, idle: () => draw.idle() && drag.idle() && take.idle() };  // for tests and for the console
}

open().then(app).catch(complain);
