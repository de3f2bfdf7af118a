// Keys and a gamepad of a page lead the arm once its panel has the mark of the folder "Hand", which says which keys,
// and where, under which header and how often [ms] they are reported. Keys that lead do nothing else: viser's own
// listeners, which move the camera by w, a, s and d, come later.
(() => {
  const WAIT = 500; // [ms] from one look for the mark to the next
  const held = new Set();
  let hand = null; // what the mark says; null while there is none
  const name = event => event.key === ' ' ? 'space' : event.key.toLowerCase();
  const typing = event => event.target.closest?.('input:not([type=checkbox]), textarea') != null;
  const hear = (event, change) => {
    if (!hand?.keys.includes(name(event)) || typing(event) || event.ctrlKey || event.altKey || event.metaKey) return;
    change(name(event));
    event.preventDefault();
    event.stopImmediatePropagation();
  };
  window.addEventListener('keydown', event => hear(event, key => held.add(key)), true);
  window.addEventListener('keyup', event => { held.delete(name(event)); hear(event, () => {}); }, true);
  window.addEventListener('blur', () => held.clear());
  const numbers = values => values.map(value => value.toFixed(3)).join(' ');
  const report = async () => {
    const mark = document.querySelector('[data-jacokin-hand]');
    hand = mark ? JSON.parse(mark.dataset.jacokinHand) : hand;
    if (hand && document.hasFocus()) {
      const pad = [...navigator.getGamepads()].find(each => each && each.connected);
      const said = new URLSearchParams({
        keys: [...held].join(' '),
        axes: pad ? numbers([...pad.axes]) : '',
        buttons: pad ? numbers([...pad.buttons].map(button => button.value)) : '',
      });
      await fetch(`${hand.path}?${said}`, {cache: 'no-store', headers: {[hand.header]: 'hand'}}).catch(() => {});
    }
    setTimeout(report, hand ? hand.period : WAIT);
  };
  report();
})();
