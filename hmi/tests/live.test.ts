// The connection of the page and hold-to-run over it: what is believed, what is sent, and when that ends.
import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';

interface Sent {
  type: string;
  seq: number;
  frame: string;
  epoch?: number;
  lease?: string;
  direction?: string;
}
class Socket {
  static OPEN = 1;
  static all: Socket[] = [];
  readyState = 1;
  sent: Sent[] = [];
  onmessage: (event: { data: string }) => void = () => {};
  onclose: (event: { code: number }) => void = () => {};
  constructor() {
    Socket.all.push(this);
  }
  send(text: string): void {
    this.sent.push(JSON.parse(text) as Sent);
  }
  close(code = 1006): void {
    this.readyState = 3;
    this.onclose({ code });
  }
  says(message: object): void {
    this.onmessage({ data: JSON.stringify(message) });
  }
}

vi.useFakeTimers();
vi.stubGlobal('WebSocket', Socket);
let asked = 0;
vi.stubGlobal('fetch', () => {
  asked += 1;
  return Promise.resolve(new Response(JSON.stringify({ user: 'anna', role: 'operator', may: [] })));
});
const { link } = await import('../src/lib/link.svelte');
const { hold } = await import('../src/lib/hold.svelte');
const { Lateness } = await import('../src/lib/age');
const { halting, journal, keys, move } = await import('../src/lib/rules');
const { sight } = await import('../src/lib/sight.svelte');
const mineAtFirst = link.mine;
vi.spyOn(sight, 'look').mockImplementation(() => {});

const WELCOME = {
  type: 'welcome', client: 'c1', user: 'anna', person: 'Anna', role: 'operator', may: ['jog'], place: 'console',
  version: '1', lease_ms: 250, renew_ms: 30, key_view_max_ms: 200, round_trip_max_ms: 100, stale_ms: 500,
}; // prettier-ignore
let socket: Socket;
let frames = 0;
let begun = 0;

/** A status issued `late_ms` ago, by a controller whose clock shows 0 when the test begins. */
function frame(tags: object = {}, late_ms = 0, more: object = {}): void {
  const issued_ms = performance.now() - begun - late_ms;
  socket.says({
    type: 'status',
    frame: `f${++frames}`,
    fresh: true,
    age_ms: late_ms,
    ...more,
    tags: { issued_ms, ...tags },
  });
}
function answer(seq: number, more: object = {}): void {
  socket.says({
    type: 'reply',
    seq,
    ok: true,
    code: '',
    text: '',
    values: {},
    epoch: null,
    journal: 0,
    ...more,
  });
}
const sent = (type: string): Sent[] => socket.sent.filter((each) => each.type === type);
const pass = (ms: number): Promise<unknown> => vi.advanceTimersByTimeAsync(ms);

beforeEach(async () => {
  await pass(1000); // a page that is loaded hears of nothing at time 0
  sight.stop = true;
  await link.start();
  socket = Socket.all.at(-1)!;
  begun = performance.now();
  socket.says(WELCOME);
  frame({ epoch: 7, authority_client: 'c2', lease_left_ms: 0 });
});
afterEach(async () => {
  hold.release('left');
  socket.close(4401);
  await pass(5000);
});

describe('what is shown', () => {
  test('before the first connection is of nobody', () => {
    expect(mineAtFirst).toBe(false);
  });

  test('is stale 400 ms after the newest frame was issued, late or not', async () => {
    expect(link.stale).toBe(false);
    await pass(350);
    expect(link.stale).toBe(false);
    await pass(100);
    expect(link.stale).toBe(true);
    frame({}, 300); // the service says that it is old
    expect(link.stale).toBe(false);
    await pass(150);
    expect(link.stale).toBe(true);
  });

  test('is not made fresh by a frame that the service calls old, or that arrives late', async () => {
    await pass(1000);
    frame({}, 450, { age_ms: 0 }); // the network was slow
    expect(link.stale).toBe(true);
    frame({}, 0, { fresh: false });
    expect(link.stale).toBe(true);
    frame({}, 0, { age_ms: null });
    expect(link.stale).toBe(true);
    frame();
    expect(link.stale).toBe(false);
  });

  test('frames that all come late do not become the measure of what is late', async () => {
    await pass(1000);
    for (let n = 0; n < 50; n++) {
      await pass(100);
      frame({}, 420, { age_ms: 0 });
    }
    expect(link.stale).toBe(true);
  });

  test('is fresh by a clock that runs 0.5 ms per second slower than that of the page, after hours too', () => {
    // 1000 s are 0.5 s by which the times of issue fall behind, which is stale; frames come every second.
    const lateness = new Lateness();
    let late = 0;
    for (let n = 0; n <= 1000; n++) late = Math.max(late, lateness.of(n * 999.5, n * 1000));
    expect(late).toBeLessThan(1);
    expect(lateness.of(1001 * 999.5 - 300, 1001 * 1000)).toBeGreaterThan(298); // what is late is late
  });

  test('is fresh at once when the controller has started anew', async () => {
    await pass(1000);
    frame();
    begun = performance.now();
    await pass(100);
    frame();
    expect(link.since()).toBe(0);
  });

  test('is stale at once without a connection, and of the new one alone after it', async () => {
    frame({ alarms: [], pos_act_deg: 12 });
    socket.close();
    expect([link.stale, link.open]).toEqual([true, false]);
    const before = asked;
    await pass(499);
    expect(asked).toBe(before);
    await pass(2);
    expect(asked).toBe(before + 1);
    socket = Socket.all.at(-1)!;
    socket.says(WELCOME);
    expect(link.tags).toEqual({});
    expect(link.mine).toBe(false);
    void link.send('stop', {});
    expect(sent('stop')[0]?.seq).toBe(1);
  });
});

test('a session that the service has ended is not tried again; a connection that is lost is', async () => {
  const before = asked;
  socket.close(4401);
  await pass(5000);
  expect([link.session, asked]).toEqual([null, before]);
  await link.start();
  Socket.all.at(-1)!.close(1006);
  await pass(5000);
  expect(link.session?.user).toBe('anna');
  expect(asked).toBeGreaterThan(before + 1);
  socket = Socket.all.at(-1)!;
});

test('each connection that is lost is followed by the next one after half a second', async () => {
  for (let n = 0; n < 4; n++) {
    const lost = socket;
    lost.close(1006);
    await pass(600);
    socket = Socket.all.at(-1)!;
    expect(socket).not.toBe(lost);
    socket.says(WELCOME);
  }
});

test('what is not known of stale data is a gap in the curves', async () => {
  frame({ time_s: 10, pos_act_deg: 1 });
  frame({ time_s: 10.05, pos_act_deg: 2 });
  await pass(1000);
  frame({ time_s: 11.05, pos_act_deg: 3 });
  const { pos_act_deg } = link.history.last(30);
  expect(pos_act_deg).toEqual([1, 2, null, 3]);
});

test('a connection that ends late takes nothing from the next one', async () => {
  const old = socket;
  old.close = () => void (old.readyState = 2); // it waits for the other side
  await link.logout();
  await link.start();
  socket = Socket.all.at(-1)!;
  expect(socket).not.toBe(old);
  socket.says(WELCOME);
  frame({ pos_act_deg: 5 });
  old.says({ type: 'status', frame: 'x', fresh: true, age_ms: 0, tags: { pos_act_deg: 99 } });
  old.onclose({ code: 4401 });
  expect([link.open, link.stale, link.session?.user, link.tags.pos_act_deg]).toEqual([
    true,
    false,
    'anna',
    5,
  ]);
  void link.send('stop', {});
  expect(sent('stop')).toHaveLength(1);
});

test('a sign of life is given with fresh frames, by who has control', async () => {
  await pass(500);
  frame({ authority_client: 'c1' });
  expect(sent('alive')).toHaveLength(1);
  await pass(500);
  frame({}, 0, { fresh: false });
  expect(sent('alive')).toHaveLength(1);
  frame({}, 450, { age_ms: 450 });
  expect(sent('alive')).toHaveLength(1);
  frame();
  expect(sent('alive')).toHaveLength(2);
  await pass(500);
  frame({ authority_client: 'c2' });
  expect(sent('alive')).toHaveLength(2);
});

test('motion is offered while the journal is slow, and a stop that an alarm has begun is not ended', () => {
  const offered = (tags: object, of: () => [boolean, string][]): boolean => {
    frame(tags);
    return !of().some(([fails]) => fails);
  };
  for (const [journal_state, may] of [
    ['ok', true],
    ['slow', true],
    ['failed', false],
  ] as const)
    // prettier-ignore
    expect(offered({ journal_state }, () => [journal()])).toBe(may);
  expect(offered({ at_rest: false, axis_state: 'discrete_motion' }, halting)).toBe(true);
  expect(offered({ at_rest: false, axis_state: 'error_stop' }, halting)).toBe(false);
  expect(offered({ at_rest: true, axis_state: 'standstill' }, halting)).toBe(false);
  // At the console a move has no cap; this page is there.
  const fast = {
    power: true,
    alarms: [],
    journal_state: 'ok',
    brake_test_overdue: false,
    enabling_switch: false,
  };
  expect(offered({ ...fast, speed_setting_deg_s: 3, speed_cap_deg_s: 1 }, move)).toBe(true);
  for (const mode of ['continuous', 'incremental'] as const) {
    expect(offered({ mode }, () => keys(mode))).toBe(false);
    expect(offered({ enabling_switch: true }, () => keys(mode))).toBe(true);
    frame({ enabling_switch: false });
  }
});

describe('a command', () => {
  test('carries the mark of the newest frame and the epoch of the newest reply', async () => {
    void link.send('move', { target_deg: 1 });
    answer(1, { ok: false, epoch: 8 });
    frame();
    void link.send('move', { target_deg: 2 });
    expect(sent('move').map(({ seq, frame, epoch }) => [seq, frame, epoch])).toEqual([
      [1, `f${frames - 1}`, 7],
      [2, `f${frames}`, 8],
    ]);
  });

  test('that stops, lets go or gives a sign of life names no epoch: none is refused for it', () => {
    link.post('release', { lease: 'a' });
    link.post('alive', {});
    for (const kind of ['stop', 'quick_stop', 'halt', 'give'] as const) void link.send(kind, {});
    expect(socket.sent.map(({ type, epoch }) => [type, epoch])).toEqual([
      ['release', undefined],
      ['alive', undefined],
      ['stop', undefined],
      ['quick_stop', undefined],
      ['halt', 7],
      ['give', 7],
    ]);
  });

  test('is answered by its own reply; without one after 2 s, at once where the connection is lost', async () => {
    const [first, second, third] = [link.send('halt', {}), link.send('halt', {}), link.send('halt', {})];
    answer(2, { text: 'second' });
    expect((await second).text).toBe('second');
    await pass(1900);
    answer(3, { text: 'third' });
    expect((await third).text).toBe('third');
    await pass(200);
    expect((await first).text).toBe('silent');
    const lost = link.send('halt', {});
    socket.close();
    expect((await lost).text).toBe('silent'); // it may have been executed
    expect((await link.send('halt', {})).text).toBe('off');
  });
});

describe('a key that is held', () => {
  test('is one lease, made longer every 30 ms and with every frame, until it is let go', async () => {
    hold.press('forward');
    await pass(95);
    expect(sent('renew')).toHaveLength(3);
    frame();
    expect(sent('renew')).toHaveLength(4);
    expect(new Set(socket.sent.map(({ lease }) => lease)).size).toBe(1);
    expect(sent('jog')[0]).toMatchObject({ direction: 'forward' });
    hold.release('released');
    expect(sent('release')[0]?.lease).toBe(sent('jog')[0]?.lease);
    await pass(200);
    frame();
    expect(sent('renew')).toHaveLength(4);
    hold.press('reverse');
    await pass(95);
    expect(sent('renew')).toHaveLength(7); // by one timer
    expect(sent('jog')[1]?.lease).not.toBe(sent('jog')[0]?.lease);
  });

  test('ends when the other is pressed too, and neither moves', async () => {
    hold.press('forward');
    hold.press('reverse');
    expect([hold.direction, hold.ended]).toEqual([null, 'both']);
    await pass(100);
    expect(socket.sent.map(({ type }) => type)).toEqual(['jog', 'release']);
  });

  test.each(['blur', 'pagehide', 'freeze', 'pointerup', 'pointercancel'])(
    'ends with %s of the window',
    (name) => {
      hold.press('forward');
      dispatchEvent(new Event(name));
      expect([hold.direction, sent('release').length]).toEqual([null, 1]);
    },
  );

  test('ends when the page is hidden', () => {
    hold.press('forward');
    const hidden = vi.spyOn(document, 'hidden', 'get').mockReturnValue(true);
    document.dispatchEvent(new Event('visibilitychange'));
    hidden.mockRestore();
    expect([hold.direction, sent('release').length]).toEqual([null, 1]);
  });

  test('moves nothing on data older than 200 ms, or where Stop is out of sight', async () => {
    await pass(210);
    hold.press('forward');
    expect([hold.ended, sent('jog').length]).toEqual(['late', 0]);
    frame();
    sight.stop = false;
    hold.press('forward');
    expect(sent('jog')).toHaveLength(0);
  });

  test('ends when the data are stale, Stop goes out of sight or the connection is lost', async () => {
    hold.press('forward');
    await pass(450);
    expect([hold.direction, hold.ended]).toEqual([null, 'stale']);
    frame();
    hold.press('forward');
    sight.stop = false;
    await pass(60);
    expect(hold.ended).toBe('unseen');
    sight.stop = true;
    frame();
    hold.press('forward');
    answer(sent('jog').at(-1)!.seq);
    await pass(0);
    socket.close();
    await pass(60);
    expect([hold.direction, hold.ended]).toEqual([null, 'stale']);
  });

  test('ends at once on a connection that takes nothing any more', async () => {
    hold.press('forward');
    socket.readyState = 2;
    await pass(40);
    expect([hold.direction, hold.ended]).toEqual([null, 'lost']);
  });

  test('has nothing beside it of how the press before has ended', () => {
    hold.press('forward');
    hold.release('released');
    expect(hold.ended).toBe('released');
    hold.press('forward');
    expect([hold.direction, hold.ended]).toEqual(['forward', '']);
  });

  test('ends 400 ms after the press where the controller has no lease of it', async () => {
    hold.press('forward');
    for (let n = 0; n < 7; n++) {
      await pass(50);
      frame({ lease_left_ms: 0 });
    }
    expect(hold.direction).toBe('forward');
    for (let n = 0; n < 2; n++) {
      await pass(50);
      frame({ lease_left_ms: 0 });
    }
    expect([hold.direction, hold.ended]).toEqual([null, 'lost']);
  });

  test('shows the refusal of its own press, and not that of one before', async () => {
    hold.press('forward');
    hold.release('released');
    hold.press('reverse');
    answer(1, { ok: false, code: 'CTL-14' });
    await pass(0);
    expect(hold.direction).toBe('reverse');
    answer(sent('jog')[1]!.seq, { ok: false, code: 'CTL-15' });
    await pass(0);
    expect([hold.direction, hold.ended, hold.refusal?.code]).toEqual([null, 'refused', 'CTL-15']);
    expect(sent('release')).toHaveLength(2);
    // What the foot tells is the refusal still, also when the release that follows it is answered.
    answer(sent('release')[1]!.seq);
    await pass(0);
    expect(link.note?.code).toBe('CTL-15');
  });
});
