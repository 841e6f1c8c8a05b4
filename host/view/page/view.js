'use strict';
// The page of `mgw serve --view`. It shows what it is told, and asks for what a person does on it:
// nothing moves by itself. docs/view.md says what the messages are.

const BEAT_MS = 100;             // in command the page says this often that it is there
const POST_AFTER_MS = 150;       // a stop that is not taken by then goes another way, too
const POST_WITHIN_MS = 3500;     // one that nobody has answered by then is not taken
const SILENT_MS = 3000;          // the server says something every second
const RECONNECT_MS = 1000;
const OLD_MS = 1000;             // a reading of before is marked
const SAID_KEPT = 12;
const SHOWN_S = 10;              // the curves' width
const TEXT_EVERY_MS = 200;       // numbers in text change no faster
const EVENTS_KEPT = 200;
const FIELDS = [
  ['position_rad', 'position', 'rad', 3], ['velocity_rad_s', 'velocity', 'rad/s', 2],
  ['current_a', 'current', 'A', 2], ['voltage_v', 'voltage', 'V', 1],
  ['motor_temperature_c', 'motor', '°C', 0], ['driver_temperature_c', 'driver', '°C', 0],
];
const CURVES_AT_FIRST = ['velocity_rad_s', 'current_a'];
const LONGEST_FRAME_BITS = 135; // GUARANTEES, G5
const ERRORS = ['unmatched', 'late', 'rejected', 'receive_overflows', 'missed_acknowledgements',
  'cancelled', 'bus_offs'];
const COLOURS = 6;
const DASHES = [[], [6, 3], [2, 3]];

const $ = (id) => document.getElementById(id);
const make = (tag, more = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), more);
  element.append(...children);
  return element;
};
const set = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};

let socket = null;
let heardAt = 0;                 // when the server said something last
let isBlind = false;             // what is shown is not how it is now
let token = '';
let grant = '';
let commands = false;
const axes = new Map();          // by number: what is known and shown of each axis
const jogs = new Map();          // by number: the jog that is held
const rearm = new Set();         // axes to be armed again when their jog's stop is confirmed
const buses = new Map();
const curves = new Map();        // by field: its canvas
const pictures = { drawn: 0, since: performance.now(), rate: 0, lost: 0, leftOut: 0, samples: 0 };
let waiting = null;              // the picture that is drawn next
let stopAsked = null;            // the stop under way
// What a test reads.
window.mgw = { pictures, axes, stops: [] };

function send(ask) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(ask));
  return true;
}

function say(text, urgent = false) {
  // Each is a line of its own: what comes at once is all told.
  const region = $(urgent ? 'urgent' : 'polite');
  region.append(make('p', {}, text));
  while (region.childElementCount > SAID_KEPT) region.firstElementChild.remove();
}

// ---------------------------------------------------------------- connection

const hex = (text) =>
  Array.from(new TextEncoder().encode(text), (byte) => byte.toString(16).padStart(2, '0')).join('');

function findToken() {
  const shown = new URLSearchParams(location.hash.slice(1)).get('token');
  if (shown) {
    sessionStorage.setItem('token', shown);
    // Not in the history, nor on the screen.
    history.replaceState(null, '', location.pathname);
  }
  token = sessionStorage.getItem('token') ?? '';
}

function connect() {
  if (!token) return askForToken();
  const own = new WebSocket(`ws://${location.host}/live`, ['mgw.view.v1', `token.${hex(token)}`]);
  socket = own;
  heardAt = performance.now();
  let opened = false;
  own.onopen = () => { opened = true; $('knock').hidden = true; };
  own.onmessage = (message) => {
    if (socket !== own) return;
    heardAt = performance.now();
    hear(JSON.parse(message.data));
  };
  own.onclose = () => {
    if (socket !== own) return;
    socket = null;
    endJogs();
    goBlind();
    showCommand(false, 'This page looks on.');
    set($('link'), opened ? 'the connection to the server is lost'
      : 'no connection: the server has gone, has no room, or the token is not its own');
    say($('link').textContent, true);
    if (!opened) askForToken();
    setTimeout(connect, RECONNECT_MS);
  };
}

// A connection that says nothing is as good as none.
setInterval(() => {
  if (!socket || performance.now() - heardAt < SILENT_MS) return;
  const silent = socket;
  silent.onclose();
  silent.close();
}, 500);

// Nothing is known of the axes any more: nothing on the page says otherwise.
function goBlind() {
  if (isBlind) return;
  isBlind = true;
  endJogs();
  for (const axis of axes.values()) {
    axis.card.classList.add('blind');
    set(axis.stateText, `unknown, was ${axis.stateText.textContent}`);
    axis.stateText.className = 'state';
    axis.state = '';
    showValues(axis);
  }
  showControls();
}

function see() {
  isBlind = false;
  for (const axis of axes.values()) axis.card.classList.remove('blind');
}

function askForToken() {
  $('knock').hidden = false;
  if (!token) set($('link'), 'this page needs the token of its server');
}

$('knock').addEventListener('submit', (event) => {
  event.preventDefault();
  const typed = $('token').value.trim();
  const had = Boolean(token);
  token = typed.includes('#token=') ? decodeURIComponent(typed.split('#token=')[1]) : typed;
  sessionStorage.setItem('token', token);
  if (!had) connect();
});

// ---------------------------------------------------------------- what is told

const told = {
  welcome(message) {
    grant = message.grant;
    showCommand(false, grant === 'command' ? 'This page looks on.'
      : 'This page may read only: it was opened from another origin.');
  },
  link(message) {
    set($('link'), message.connected ? 'connected' : `no gateway: ${message.message}`);
    if (message.connected) return see();
    goBlind();
    say(`no gateway: ${message.message}`, true);
  },
  axes(message) {
    set($('link'), `${message.name ?? 'connected'}: ${message.board}, firmware ${message.firmware}`);
    // Their buttons go: who holds one can no longer let it go.
    endJogs();
    const armed = [...axes.values()].filter((axis) => axis.armedHere).map((axis) => axis.number);
    axes.clear();
    isBlind = false;
    $('axes').replaceChildren();
    $('legend').replaceChildren();
    for (const axis of message.axes) addAxis(axis);
    for (const number of armed) if (axes.has(number)) axes.get(number).armedHere = true;
    showControls();
    if (message.axes.length === 0) {
      $('axes').append('No axis is configured: mgw config apply FILE does it.');
    }
  },
  gateway(message) {
    const { e_stop_latched: latched } = message.status;
    window.mgw.uncertainty_us = message.uncertainty_us;
    document.body.classList.toggle('latched', latched);
    set($('latch'), latched ? 'The e-stop is latched: mgw clear gateway releases it.' : '');
  },
  bus(message) {
    const { bus } = message;
    buses.set(bus.bus, { ...bus, ...rateOf(bus, buses.get(bus.bus)) });
    showBuses();
  },
  axis(message) {
    const axis = axes.get(message.axis.axis);
    if (!axis) return;
    showState(axis, message.axis.state, message.axis.stop_confirmed, message.trip_text);
    for (const [field] of FIELDS) {
      const reading = message.axis[field];
      if (!reading) continue;
      axis.values.set(field, reading.value);
      axis.readAt.set(field, performance.now() - reading.age_us / 1000);
    }
    const faults = message.axis.faults ?? [];
    set(axis.faults, faults.length ? `faults: ${faults.join(', ')}` : '');
    showValues(axis);
  },
  samples(message) {
    waiting = message;
  },
  incidents(message) {
    const lines = message.incidents.map((one) => {
      const time = one.trip ? `${(one.trip.time_us / 1e6).toFixed(1)} s` : '';
      return make('li', {}, `start ${one.start} ${time}  ${one.text}`);
    });
    $('trips').replaceChildren(...lines);
  },
  told(message) {
    const line = make('li', {}, message.text);
    $('events').prepend(line);
    while ($('events').childElementCount > EVENTS_KEPT) $('events').lastElementChild.remove();
    if (message.what.event === 'state_changed') followState(message.what);
    if (message.what.event === 'tripped') say(message.text, true);
    if (message.what.event === 'stop_confirmed') noteFirstBit(message);
  },
  command(message) {
    commands = message.state === 'taken';
    if (!commands) endJogs();
    showCommand(commands, message.message);
    say(message.message);
  },
  armed(message) {
    const axis = axes.get(message.axis);
    if (axis) axis.armedHere = true;
    showControls();
    say(`axis ${message.axis} is armed`);
  },
  disarmed(message) {
    const axis = axes.get(message.axis);
    if (axis) axis.armedHere = false;
    jogs.get(message.axis)?.end(false);
    showControls();
  },
  refused(message) {
    set($('refused'), message.message);
  },
  stop(message) {
    hearStop(message);
  },
};

function hear(message) {
  told[message.event]?.(message);
}

// ---------------------------------------------------------------- axes

function addAxis(summary) {
  const number = summary.axis;
  const called = summary.name ? `Axis ${number}, ${summary.name}` : `Axis ${number}`;
  const isThruster = summary.protocol === 'thruster';
  const axis = {
    number, called, armedHere: false, state: '', stateTime: 0, values: new Map(), readAt: new Map(), cells: new Map(),
    past: new Map(FIELDS.map(([field]) => [field, []])), pictured: 0,
    jogMode: isThruster ? 'signal' : 'velocity',
  };
  const title = make('h3', { id: `axis-${number}` }, called);
  axis.stateText = make('span', { className: 'state' });
  axis.trip = make('p', { className: 'trip' });
  axis.faults = make('p', { className: 'trip' });
  const values = make('dl');
  for (const [field, name, unit] of FIELDS) {
    const cell = make('dd', {}, '–');
    axis.cells.set(field, cell);
    values.append(make('dt', {}, name, make('span', { className: 'spoken' }, ` in ${unit}`)), cell);
  }
  const what = `${summary.protocol ?? 'no protocol'}, bus ${summary.bus ?? '–'}, ` +
    `node ${summary.node ?? '–'}`;
  axis.card = make('article', {}, make('header', {}, title, axis.stateText),
    make('p', { className: 'faint' }, what), axis.trip, axis.faults, values, controls(axis));
  axis.card.setAttribute('aria-labelledby', title.id);
  axes.set(number, axis);
  $('axes').append(axis.card);
  const colour = make('li', { className: `c${number % COLOURS}` }, called);
  $('legend').append(colour);
  showState(axis, summary.state, summary.stop_confirmed, null);
  showControls();
}

function controls(axis) {
  const { number, called } = axis;
  const button = (text, name, act) => {
    const made = make('button', { type: 'button' }, text);
    made.setAttribute('aria-label', `${called}: ${name}`);
    if (act) made.addEventListener('click', act);
    return made;
  };
  axis.arm = button('Arm', 'arm', () => {
    set($('refused'), '');
    send({ ask: 'arm', axis: number });
  });
  axis.rest = button('Stop axis', 'stop and disarm', () => {
    jogs.get(number)?.end(false);
    send({ ask: 'rest', axis: number });
  });
  axis.clear = button('Clear', 'clear the trip', () => {
    set($('refused'), '');
    send({ ask: 'clear', axis: number });
  });
  const field = (text, value, step, unit) => {
    const input = make('input', { type: 'number', value, step });
    input.setAttribute('aria-label', `${called}: ${text}${unit ? `, ${unit}` : ''}`);
    return input;
  };
  const isSignal = axis.jogMode === 'signal';
  axis.speed = field('jog speed', isSignal ? 0.05 : 0.3, 0.05, isSignal ? 'fraction' : 'rad/s');
  axis.speed.min = '0';
  axis.back = button('◀ −', 'jog clockwise while held');
  axis.on = button('+ ▶', 'jog counter-clockwise while held');
  axis.back.classList.add('jog');
  axis.on.classList.add('jog');
  holdToRun(axis, axis.back, -1);
  holdToRun(axis, axis.on, +1);
  axis.mode = make('select');
  axis.mode.setAttribute('aria-label', `${called}: setpoint`);
  for (const [mode, unit] of [['velocity', 'rad/s'], ['position', 'rad'], ['current', 'A'],
    ['signal', 'fraction']]) {
    axis.mode.append(make('option', { value: mode }, `${mode} ${unit}`));
  }
  axis.mode.value = axis.jogMode;
  axis.value = field('setpoint value', 0, 'any');
  axis.limit = field('speed limit of a position', 1, 'any', 'rad/s');
  axis.hold = button('Hold', 'hold this setpoint', () => {
    const [value, limit] = [axis.value.valueAsNumber, axis.limit.valueAsNumber];
    if (!Number.isFinite(value)) return set($('refused'), `${called}: the setpoint is no number`);
    set($('refused'), '');
    const ask = { ask: 'set', axis: number, mode: axis.mode.value, value };
    if (axis.mode.value === 'position') ask.speed_limit_rad_s = limit;
    send(ask);
  });
  axis.mode.addEventListener('change', showControls);
  const label = (text, input) => make('label', { className: 'row' }, text, input);
  const group = make('fieldset', {}, make('legend', {}, 'Move'),
    make('p', { className: 'row' }, axis.arm, axis.rest, axis.clear),
    make('p', { className: 'row' }, axis.back, axis.on, label('at', axis.speed)),
    make('p', { className: 'row' }, axis.mode, axis.value, axis.limit, axis.hold));
  return group;
}

function showState(axis, state, confirmed, trip) {
  const text = state === 'tripped' ? `tripped, stop ${confirmed ? 'confirmed' : 'not confirmed'}`
    : state;
  if (text !== axis.stateText.textContent) {
    axis.stateText.textContent = text;
    axis.stateText.className = `state ${state}`;
    if (axis.state) say(`${axis.called}: ${text}`);
  }
  if (state === 'tripped') {
    if (trip) set(axis.trip, trip);
  } else {
    set(axis.trip, '');
  }
  if (axis.state === state) return;
  axis.state = state;
  if (['idle', 'holding'].includes(state) && rearm.delete(axis.number) && commands) {
    send({ ask: 'arm', axis: axis.number });
  }
  if (state === 'tripped') rearm.delete(axis.number);
  showControls();
}

function followState({ axis: number, state, stop_confirmed: confirmed, time_us: time }) {
  const axis = axes.get(number);
  if (!axis) return;
  axis.stateTime = time;
  showState(axis, state, confirmed, null);
}

function showValues(axis) {
  for (const [field, , unit, digits] of FIELDS) {
    const value = axis.values.get(field);
    const age = performance.now() - (axis.readAt.get(field) ?? 0);
    const isOld = value !== undefined && (isBlind || age > OLD_MS);
    const text = value === undefined ? '–' : `${value.toFixed(digits)} ${unit}`;
    const cell = axis.cells.get(field);
    set(cell, isOld ? `${text}, ${(age / 1000).toFixed(0)} s old` : text);
    cell.classList.toggle('old', isOld);
  }
}

function enable(element, on) {
  // One that has the focus keeps it: a key that is held on it must still be heard.
  if (element.disabled === on) element.disabled = !on;
}

function showControls() {
  for (const axis of axes.values()) {
    const isArmed = commands && axis.armedHere;
    enable(axis.arm, commands && ['idle', 'holding'].includes(axis.state));
    enable(axis.rest, commands && axis.armedHere);
    enable(axis.clear, commands && axis.state === 'tripped');
    const isHeld = jogs.has(axis.number);
    enable(axis.back, isArmed || isHeld);
    enable(axis.on, isArmed || isHeld);
    enable(axis.hold, isArmed);
    axis.limit.hidden = axis.mode.value !== 'position';
  }
}

// ---------------------------------------------------------------- command

function showCommand(has, text) {
  commands = has;
  set($('command'), text);
  enable($('take'), !has && grant === 'command' && socket?.readyState === WebSocket.OPEN);
  enable($('release'), has);
  if (!has) {
    for (const axis of axes.values()) axis.armedHere = false;
    rearm.clear();
  }
  showControls();
}

$('take').addEventListener('click', () => {
  set($('refused'), '');
  set($('command'), 'taking command …');
  send({ ask: 'take' });
});
$('release').addEventListener('click', () => {
  endJogs();
  send({ ask: 'release' });
});

setInterval(() => {
  if (commands) send({ ask: 'here' });
}, BEAT_MS);

// A page that nobody sees moves nothing.
document.addEventListener('visibilitychange', () => {
  if (!document.hidden || !commands) return;
  endJogs();
  send({ ask: 'release' });
});

// A jog lasts as long as its button is held, by a finger, the mouse or a key.
function holdToRun(axis, button, sign) {
  const begin = () => {
    const speed = axis.speed.valueAsNumber;
    if (jogs.has(axis.number) || !axis.armedHere) return;
    if (!(speed > 0)) return set($('refused'), `${axis.called}: the jog speed is above 0`);
    set($('refused'), '');
    const ask = { ask: 'jog', axis: axis.number, mode: axis.jogMode, value: sign * speed };
    send(ask);
    const beat = setInterval(() => send(ask), BEAT_MS);
    button.classList.add('held');
    const end = (stops) => {
      clearInterval(beat);
      button.classList.remove('held');
      jogs.delete(axis.number);
      if (stops) {
        if ($('again').checked && axis.state === 'active') rearm.add(axis.number);
        send({ ask: 'rest', axis: axis.number });
      }
      showControls();
    };
    jogs.set(axis.number, { end, button });
  };
  const end = () => {
    const jog = jogs.get(axis.number);
    if (jog?.button === button) jog.end(true);
  };
  button.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    begin();
  });
  for (const name of ['pointerup', 'pointercancel', 'lostpointercapture', 'blur']) {
    button.addEventListener(name, end);
  }
  button.addEventListener('contextmenu', (event) => event.preventDefault());
  button.addEventListener('keydown', (event) => {
    if (![' ', 'Enter'].includes(event.key)) return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener('keyup', (event) => {
    if ([' ', 'Enter'].includes(event.key)) end();
  });
}

function endJogs() {
  for (const jog of [...jogs.values()]) jog.end(true);
}
window.addEventListener('blur', endJogs);
window.addEventListener('pagehide', endJogs);

// ---------------------------------------------------------------- stop

// The stop goes at once, by the connection that is open; if it is not taken soon, by a request of
// its own, too.
function stop(event) {
  rearm.clear();
  const asked = { at: performance.now(), pressed_ms: performance.timeOrigin + event.timeStamp,
    taken: false, bits: [] };
  stopAsked = asked;
  window.mgw.stops.push(asked);
  const sent = send({ ask: 'stop' });
  for (const jog of [...jogs.values()]) jog.end(false);
  set($('stopped'), 'Stop sent …');
  setTimeout(() => { if (!asked.taken) postStop(asked); }, sent ? POST_AFTER_MS : 0);
}

async function postStop(asked) {
  try {
    const answer = await fetch('/stop', { method: 'POST', signal: AbortSignal.timeout(POST_WITHIN_MS),
      headers: { Authorization: `Bearer ${hex(token)}` } });
    const text = await answer.text();
    if (answer.ok) hearStop(JSON.parse(text));
    else if (!asked.taken) set($('stopped'), `The stop is NOT taken: ${text} Use the e-stop.`);
  } catch (error) {
    if (!asked.taken) {
      set($('stopped'), `The stop is NOT taken, the server does not answer (${error.message}). ` +
        'Use the e-stop.');
    }
  }
}

const STOP_WORDS = {
  confirmed: 'confirmed', not_confirmed: 'NOT CONFIRMED, the gateway goes on stopping it',
  not_configured: 'nothing to stop, never armed', bus_not_configured: 'nothing to stop, never armed',
};

function hearStop(message) {
  if (stopAsked) stopAsked.taken = true;
  if (message.phase === 'taken') {
    set($('stopped'), 'Stop taken, the motors have yet to confirm it …');
  } else if (message.phase === 'failed') {
    set($('stopped'), `Stop: ${message.message}`);
  } else if (message.axes.length) {
    const each = message.axes.map((axis) => `axis ${axis.axis}: ${STOP_WORDS[axis.stop]}`);
    const all = message.axes.every((axis) => axis.stop === 'confirmed');
    set($('stopped'), (all ? `Stopped, confirmed by all ${each.length} axes` : each.join('; ')) +
      firstBit());
  }
}

// On the computer of the server the clocks are one.
function noteFirstBit(message) {
  const { reaction_us: reaction, elapsed_us: elapsed } = message.what;
  if (stopAsked) stopAsked.bits.push(message.host_ms - (elapsed - reaction) / 1e3);
}

function firstBit() {
  const here = ['127.0.0.1', 'localhost', '[::1]'].includes(location.hostname);
  if (!here || !stopAsked?.bits.length) return '';
  const took = Math.min(...stopAsked.bits) - stopAsked.pressed_ms;
  return `; first bit on the bus ${took.toFixed(1)} ms after the press`;
}

$('stop').addEventListener('click', stop);
document.addEventListener('keydown', (event) => {
  if (event.key !== 'Escape' || event.repeat) return;
  event.preventDefault();
  stop(event);
}, true);

// ---------------------------------------------------------------- buses

// Frames between two looks, each taken for one of the longest: the load is at most that.
function rateOf(bus, before) {
  const at = performance.now();
  const frames = bus.counters.transmitted + bus.counters.received;
  const seen = { at, frames };
  if (!before || !bus.config || frames < before.frames) return seen;
  const passed = (at - before.at) / 1000;
  if (passed < 0.5) return { ...before, ...bus, at: before.at, frames: before.frames };
  const rate = (frames - before.frames) / passed;
  return { ...seen, rate, load: rate * LONGEST_FRAME_BITS / bus.config.bitrate_bit_s };
}

function showBuses() {
  const rows = [...buses.values()].sort((a, b) => a.bus - b.bus).map((bus) => {
    const errors = ERRORS.map((name) => [name, bus.counters[name]])
      .concat([['transmit_errors', bus.transmit_errors], ['receive_errors', bus.receive_errors]])
      .filter(([, count]) => count > 0)
      .map(([name, count]) => `${name.replaceAll('_', ' ')} ${count}`);
    const cells = [
      String(bus.bus), bus.state.replaceAll('_', ' '),
      bus.load === undefined ? '–'
        : `at most ${(bus.load * 100).toFixed(0)} %, ${bus.rate.toFixed(0)} frames/s`,
      errors.join(', ') || 'none',
      bus.config ? `${bus.config.bitrate_bit_s / 1000} kbit/s` : 'not configured',
    ];
    return make('tr', {}, ...cells.map((cell, place) =>
      make(place ? 'td' : 'th', place ? {} : { scope: 'row' }, cell)));
  });
  $('buses').replaceChildren(...rows);
}

// ---------------------------------------------------------------- curves

for (const [field, name, unit] of FIELDS) {
  const box = make('input', { type: 'checkbox', checked: CURVES_AT_FIRST.includes(field) });
  box.addEventListener('change', () => showCurve(field, box.checked));
  $('fields').append(make('label', {}, box, ` ${name} ${unit}  `));
  if (box.checked) showCurve(field, true);
}

function showCurve(field, shown) {
  const at = curves.get(field);
  if (!shown) {
    at?.figure.remove();
    curves.delete(field);
    return;
  }
  const [, name, unit] = FIELDS.find(([of]) => of === field);
  const canvas = make('canvas');
  canvas.setAttribute('role', 'img');
  const figure = make('figure', {}, make('figcaption', {}, `${name}, ${unit}`), canvas);
  curves.set(field, { canvas, figure, name, unit });
  $('curves').append(figure);
}

function takePicture(message) {
  const now = performance.now() / 1000;
  pictures.lost = message.lost;
  pictures.leftOut = message.left_out;
  for (const sample of message.axes) {
    const axis = axes.get(sample.axis);
    if (!axis) continue;
    pictures.samples += sample.samples;
    for (const [field] of FIELDS) {
      if (!sample[field]) continue;
      const past = axis.past.get(field);
      past.push([now, ...sample[field]]);
      while (past.length && past[0][0] < now - SHOWN_S - 1) past.shift();
      axis.values.set(field, sample[field][2]);
      axis.readAt.set(field, performance.now());
    }
    // An event may have told of a later state.
    if (sample.time_us >= axis.stateTime) {
      showState(axis, sample.state, sample.stop_confirmed, null);
    }
    if (now - axis.pictured >= TEXT_EVERY_MS / 1000) {
      axis.pictured = now;
      showValues(axis);
    }
  }
}

function drawCurve(field, { canvas, name, unit }) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const context = canvas.getContext('2d');
  const style = getComputedStyle(document.documentElement);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const now = performance.now() / 1000;
  let [low, high] = [Infinity, -Infinity];
  for (const axis of axes.values()) {
    for (const [, least, most] of axis.past.get(field)) {
      low = Math.min(low, least);
      high = Math.max(high, most);
    }
  }
  context.font = '12px system-ui, sans-serif';
  context.fillStyle = style.getPropertyValue('--faint');
  if (low > high) {
    context.fillText('no values yet', 8, 20);
    canvas.setAttribute('aria-label', `${name}: no values yet`);
    return;
  }
  const room = Math.max((high - low) * 0.08, 0.01);
  [low, high] = [low - room, high + room];
  const x = (time) => width - (now - time) / SHOWN_S * width;
  const y = (value) => height - (value - low) / (high - low) * height;
  for (const axis of axes.values()) {
    const past = axis.past.get(field);
    if (!past.length) continue;
    const colour = style.getPropertyValue(`--c${axis.number % COLOURS}`);
    context.strokeStyle = colour;
    context.lineWidth = 1.5;
    context.setLineDash(DASHES[Math.floor(axis.number / COLOURS) % DASHES.length]);
    context.beginPath();
    for (const [time, least, most, last] of past) {
      const at = x(time);
      context.lineTo(at, y(least));
      if (most > least) context.lineTo(at, y(most));
      context.lineTo(at, y(last));
    }
    context.stroke();
  }
  context.setLineDash([]);
  context.fillText(`${high.toPrecision(3)} ${unit}`, 6, 14);
  context.fillText(`${low.toPrecision(3)} ${unit}`, 6, height - 6);
  context.fillText(`${SHOWN_S} s`, width - 30, height - 6);
}

function describeCurves() {
  for (const [field, { canvas, name, unit }] of curves) {
    const each = [...axes.values()].filter((axis) => axis.values.has(field))
      .map((axis) => `axis ${axis.number} ${axis.values.get(field).toPrecision(3)}`);
    canvas.setAttribute('aria-label', `${name} in ${unit} over ${SHOWN_S} s: ` +
      (each.join(', ') || 'no values yet'));
  }
}

function frame() {
  requestAnimationFrame(frame);
  if (!waiting) return;
  const picture = waiting;
  waiting = null;
  takePicture(picture);
  for (const [field, curve] of curves) drawCurve(field, curve);
  pictures.drawn += 1;
  send({ ask: 'seen', tick: picture.tick });
  const passed = performance.now() - pictures.since;
  if (passed < 1000) return;
  pictures.rate = pictures.drawn / passed * 1000;
  set($('rate'), `${pictures.rate.toFixed(0)} pictures and ` +
    `${Math.round(pictures.samples / passed * 1000)} samples a second; ` +
    `left out for this page: ${pictures.leftOut}; lost on the way to the server: ${pictures.lost}`);
  Object.assign(pictures, { drawn: 0, samples: 0, since: performance.now() });
  describeCurves();
}

findToken();
connect();
requestAnimationFrame(frame);
