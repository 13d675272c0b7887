// Poses of somebody who is tracked now.
const kSeconds = 2;

const pause = (seconds) => new Promise((done) => { setTimeout(done, 1000 * seconds); });

// Asks for the next pose when the last one was shown: a slow page leaves poses out, and nothing piles up.
// @param ask `source.live` for the stage in view, given the number of the last pose
// @param show takes { number, tracked, dofs, geometry, rate: poses a second that the tracker sends }, or null after the last
// @param wanted whether to follow now  @param failed takes errors
export async function followLive(ask, show, wanted, failed) {
  let number = 0, arrivals = [];
  for (;;) {
    try {
      const latest = wanted() && !document.hidden ? await ask(number) : null;
      if (latest && wanted()) {
        const now = performance.now() / 1000;
        number = latest.number;
        arrivals = [...arrivals.filter(({ when }) => now - when < kSeconds), { when: now, number }];
        const { when, number: first } = arrivals[0];
        show({ ...latest, rate: now > when ? (number - first) / (now - when) : 0 });
      } else {
        show(null);
        if (!wanted() || document.hidden) await pause(0.3);
      }
    } catch (error) {
      show(null);
      failed(error);
      await pause(kSeconds);
    }
  }
}
