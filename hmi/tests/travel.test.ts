import { expect, test } from 'vitest';
import {
  angleText,
  begin,
  continued,
  endOf,
  meant,
  read,
  refusal,
  rests,
  sectors,
  usual,
  wayTo,
} from '../src/lib/travel';
import type { Message, Tags } from '../src/lib/tables';

type Known = Partial<Tags>;
/** Travel of -180 to +180 deg between stops at +-187 deg. */
const CABLE: Known = {
  axis_kind: 'linear',
  display: 'signed',
  pos_min_deg: -180,
  pos_max_deg: 180,
  reach_min_deg: -180,
  reach_max_deg: 180,
  mechanical_stop_min_deg: -187,
  mechanical_stop_max_deg: 187,
  over_travel_min_deg: -180.5,
  over_travel_max_deg: 180.5,
};
const ROUND: Known = { ...CABLE, display: '0..360' };
const TURNING: Known = { axis_kind: 'modulo', pos_min_deg: -180, pos_max_deg: 180 };

function values(message: Message | null): Record<string, unknown> {
  if (message === null || typeof message === 'string') throw new Error('no values');
  return message.values;
}
const codeOf = (message: Message | null): string | null =>
  message !== null && typeof message === 'object' && 'code' in message ? message.code : null;

test.each([
  [-90, 270],
  [-0.004, -0.004], // an axis that settles at 0
  [-0.006, 359.994],
  [180, 180],
  [-180, 180],
  [720, 0],
])('%s deg of the axis is read as %s deg from 0 to 360', (deg, shown) => {
  expect(read(deg, ROUND)).toBeCloseTo(shown, 9);
});

test('an angle with a sign is read as it is, that of a turning axis within its turn', () => {
  expect([begin(CABLE), read(-190, CABLE), read(null, ROUND)]).toEqual([null, -190, null]);
  expect([begin(TURNING), read(190, TURNING), read(-550, TURNING)]).toEqual([-180, -170, 170]);
});

test('two places of one reading are told apart by the end at which they lie', () => {
  expect([-180, 180, -172, 0].map((deg) => endOf(deg, ROUND))).toEqual(['−', '+', '', '']);
  expect(endOf(-180, CABLE)).toBe('');
  expect(angleText(-180, 1, ROUND)).toMatch(/^180\.0° \(.*−.*\)$/);
});

test('what is typed as 0 to 360 is the angle of travel that is read so', () => {
  expect([90, 180, -180, 270, 360].map((deg) => meant(deg, ROUND))).toEqual([90, 180, -180, -90, 0]);
  // What the page never shows is left as it is, and refused: 140 or 170 deg were not meant.
  expect([500, 360.1, -190].map((deg) => meant(deg, ROUND))).toEqual([500, 360.1, -190]);
  expect(meant(270, CABLE)).toBe(270);
  // Travel of 100 to 460 deg.
  const above: Known = { ...ROUND, pos_min_deg: 100, pos_max_deg: 460 };
  expect([90, 100, 400].map((deg) => meant(deg, above))).toEqual([450, 100, 400]);
});

test('the way of a turning axis goes in the direction that was chosen', () => {
  const from = { ...TURNING, pos_ref_deg: 350 };
  expect(wayTo(10, 'shortest', from)).toBeCloseTo(20, 9);
  expect(wayTo(10, 'positive', from)).toBeCloseTo(20, 9);
  expect(wayTo(10, 'negative', from)).toBeCloseTo(-340, 9);
  expect(wayTo(10, 'current', from)).toBeNull();
  expect(wayTo(300, 'shortest', from)).toBeCloseTo(-50, 9);
  expect(wayTo(300, 'positive', from)).toBeCloseTo(310, 9);
  // Nobody means a whole turn by the place where the axis stands.
  expect(wayTo(350.003, 'negative', from)).toBeCloseTo(0.003, 9);
  expect(wayTo(349.997, 'positive', from)).toBeCloseTo(-0.003, 9);
  expect(wayTo(-170, 'shortest', { ...CABLE, pos_ref_deg: 170 })).toBe(-340);
});

test('a target beyond the travel is refused with what is left on that side', () => {
  const at = { ...CABLE, pos_ref_deg: 90 };
  expect(refusal(180, 'shortest', at)).toBeNull();
  expect(refusal(-180, 'shortest', at)).toBeNull();
  expect(codeOf(refusal(200, 'shortest', at))).toBe('CTL-09');
  expect(values(refusal(200, 'shortest', at))).toEqual({ measured: 200, limit: 180, position: 90, left: 90 });
  expect(values(refusal(-200, 'shortest', at))).toEqual({
    measured: -200,
    limit: -180,
    position: 90,
    left: 270,
  });
});

test('the way back from outside is open, the way further out is not', () => {
  expect(refusal(-180.2, 'shortest', { ...CABLE, pos_ref_deg: -180.4 })).toBeNull();
  expect(refusal(180.2, 'shortest', { ...CABLE, pos_ref_deg: 180.4 })).toBeNull();
  const further = refusal(-180.45, 'shortest', { ...CABLE, pos_ref_deg: -180.4 });
  expect(values(further).left).toBe(0);
});

test('both ends keep their sign in a sentence where they read alike', () => {
  const at = { ...ROUND, pos_ref_deg: -90 };
  expect(values(refusal(-200, 'shortest', at))).toEqual({
    measured: 160,
    limit: -180,
    position: 270,
    left: 90,
  });
});

test('a sector is named that lies between, and the way round where the axis has one', () => {
  const fenced: Known = {
    ...CABLE,
    no_go_deg: [
      [50, 60],
      [100, 120],
    ],
    reach_max_deg: 49,
    pos_ref_deg: 10,
  };
  const found = refusal(80, 'shortest', fenced);
  expect(codeOf(found)).toBe('CTL-18');
  expect(values(found)).toMatchObject({ begin: 50, end: 60, limit: 49, position: 10 });
  expect(values(found).round).toEqual({ words: 'NO_WAY_ROUND', values: {} });
  const turning: Known = {
    ...TURNING,
    no_go_deg: [[50, 60]],
    pos_ref_deg: 10,
    reach_min_deg: -299,
    reach_max_deg: 49,
  };
  expect(values(refusal(90, 'positive', turning)).round).toEqual({
    words: 'WAY_ROUND',
    values: { way: -280 },
  });
  expect(refusal(90, 'negative', turning)).toBeNull();
  expect(values(refusal(55, 'positive', turning)).round).toEqual({ words: 'NO_WAY_ROUND', values: {} });
});

test('of two sectors on one side the nearer one is named, whichever the file has first', () => {
  const near: [number, number] = [-60, -50];
  for (const no_go_deg of [
    [[-120, -100], near],
    [near, [-120, -100]],
  ] as [number, number][][]) {
    const at = { ...CABLE, no_go_deg, pos_ref_deg: 0, reach_min_deg: -50 };
    const { begin: from, end: to } = values(refusal(-90, 'shortest', at));
    expect([from, to]).toEqual(near);
  }
});

test('an angle of a turning axis beyond a turn may have been meant as a way', () => {
  expect(codeOf(refusal(361, 'positive', { ...TURNING, pos_ref_deg: 0 }))).toBe('CTL-01');
  expect(refusal(-360, 'shortest', { ...TURNING, pos_ref_deg: 0 })).toBeNull();
});

test('sectors of a turning axis lie in every turn, one over the end of the turn too', () => {
  const over: Known = { ...TURNING, no_go_deg: [[170, -170]] };
  expect(sectors(over, 360, 1080)).toEqual([
    [530, 550],
    [890, 910],
  ]);
  expect(sectors({ ...CABLE, no_go_deg: [[50, 60]] }, 360, 1080)).toEqual([[50, 60]]);
});

test('a line over the end of the turn goes on', () => {
  expect(continued([null, 170, -170, null, 170, -20])).toEqual([null, 170, 190, null, 170, 340]);
});

test('buttons are inside of what can be reached', () => {
  expect(usual(CABLE)).toEqual([-90, 0, 90]);
  expect(usual({ ...CABLE, reach_min_deg: -40, reach_max_deg: 40 })).toEqual([-30, -15, 0, 15, 30]);
});

test('of two angles that read alike one has a button: the one that is meant by what it shows', () => {
  const wide: Known = { pos_min_deg: -270, pos_max_deg: 270, reach_min_deg: -270, reach_max_deg: 270 };
  expect(usual({ ...wide, display: '-180..180' })).toEqual([-180, -90, 0, 90, 180]);
  expect(usual({ ...wide, display: '0..360' })).toEqual([-90, 0, 90, 180]);
  const turn: Known = { pos_min_deg: 0, pos_max_deg: 360, reach_min_deg: 0, reach_max_deg: 360 };
  expect(usual({ ...turn, display: '0..360' })).toEqual([90, 180, 270]);
});

test('an axis is at rest when its set-point and the axis itself stand', () => {
  const stands: Known = { at_rest: true, vel_act_deg_s: 0.01, speed_min_deg_s: 0.6 };
  expect(rests(stands)).toBe(true);
  // A quick stop has left its set-point behind.
  expect(rests({ ...stands, vel_act_deg_s: -2.8 })).toBe(false);
  expect(rests({ ...stands, vel_act_deg_s: 0.061 })).toBe(false);
  expect(rests({ ...stands, vel_act_deg_s: null })).toBe(false);
  expect(rests({ ...stands, at_rest: false })).toBe(false);
});
