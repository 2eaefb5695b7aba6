// Time: playing, scrubbing, hit by hit; slow round each of them.
"use strict";

const SLOW = 0.1;
const SLOW_BEFORE_S = 0.2;
const SLOW_AFTER_S = 0.5;

function makePlayer(show) {
  const end = () => Math.max(flight.duration_s, 0.001); // a live flight's is later each time
  const hits = flight.moments.map((moment) => moment.t);
  const player = { time: 0, isPlaying: false, speed: 1, slows: true };
  let last = null;

  player.seek = (time) => {
    player.time = Math.min(end(), Math.max(0, time));
    show(player.time);
  };

  player.play = (plays) => {
    if (plays && player.time >= end()) player.time = 0;
    player.isPlaying = plays;
    last = null;
    if (plays) requestAnimationFrame(frame);
    show(player.time);
  };

  function frame(stamp) {
    if (!player.isPlaying) return;
    // A page that was hidden goes on where it was.
    const elapsed = last === null ? 0 : Math.min(0.1, (stamp - last) / 1000);
    last = stamp;
    player.seek(player.time + elapsed * player.speed * pace());
    if (player.time >= end()) player.play(false);
    else requestAnimationFrame(frame);
  }

  function pace() {
    const isNear = hits.some((hit) => hit - SLOW_BEFORE_S <= player.time && player.time <= hit + SLOW_AFTER_S);
    return player.slows && isNear ? SLOW : 1;
  }

  // To the hit before or after; its number, or -1 where there is none.
  player.hop = (forward) => {
    const later = hits.findIndex((hit) => hit > player.time + 1e-4);
    const earlier = hits.findLastIndex((hit) => hit < player.time - 1e-4);
    const number = forward ? later : earlier;
    if (number >= 0) player.seek(hits[number]);
    return number;
  };

  // To the next or the last IMU sample.
  player.step = (forward) => {
    const times = tables.imu.length ? tables.imu.columns.t : tables.path.columns.t;
    const row = rowAt(times, player.time + (forward ? 1e-6 : -1e-6)) + (forward ? 1 : 0);
    if (row >= 0 && row < times.length) player.seek(times[row]);
  };
  return player;
}

function onKeys(player, actions) {
  document.addEventListener("keydown", (pressed) => {
    const on = pressed.target.tagName;
    if (pressed.ctrlKey || pressed.metaKey || pressed.altKey || on === "SELECT") return;
    // A button that has the focus is pressed by space itself.
    if (pressed.key === " " && (on === "BUTTON" || on === "SUMMARY" || on === "A" || pressed.target.type === "checkbox")) return;
    const keys = {
      " ": () => player.play(!player.isPlaying),
      ArrowLeft: () => (pressed.shiftKey ? player.seek(player.time - 1) : player.step(false)),
      ArrowRight: () => (pressed.shiftKey ? player.seek(player.time + 1) : player.step(true)),
      Home: () => player.seek(0),
      End: () => player.seek(flight.duration_s),
      n: () => actions.hop(true),
      p: () => actions.hop(false),
      f: actions.follow,
      "+": () => actions.nearer(0.8),
      "-": () => actions.nearer(1.25),
    };
    const action = keys[pressed.key.length === 1 ? pressed.key.toLowerCase() : pressed.key];
    if (!action) return;
    pressed.preventDefault();
    action();
  });
}
