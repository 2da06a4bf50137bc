// Help for each area, opened by F1.
export const help = {
  display: [
    'The axis as it is: angle and speed as measured, the target, and the way to rest if Stop were pressed now.',
    'The drawing is seen from the couch, angles clockwise. The bars compare following error and torque with their limits.',
    'The strip chart keeps ten minutes of this page. Values in grey are older than half a second: do not believe them.',
  ],
  operation: [
    'Take control, switch power on, choose a mode. Continuous moves while a key is held; incremental moves one step a press.',
    'A key that is grey says why beside it. Who has control alone can move; Stop is for everybody.',
    'Move to an angle shows from, to, way and time before it is pressed.',
  ],
  settings: [
    'Speed, increment, override and acceleration, within the limits of the machine. What is outside is refused, never changed silently.',
    'Language, theme and alarm sound belong to this browser alone. The table says which role may do what.',
  ],
  alarms: [
    'Active alarms: "came first" is the one that stopped the axis and stands on top, others follow from it; then the newest first.',
    'Acknowledge says that you have seen it, and silences the sound. Reset clears what is gone; it never switches power on.',
    'The shift log keeps lines with name and time in the journal. "Here now" shows who has this page open, and who has control.',
  ],
  diagnosis: [
    'State of the drive, interlocks, timing of the scan, journal and recordings. Nothing here moves the axis.',
    'A recording has every scan around whatever happens; it opens in Python, or with gantryctl trace.',
  ],
  scope: [
    'Samples of up to eight tags around a trigger. "Sampled every" says how often each one is measured.',
    'auto shows what comes, normal keeps each trigger, single holds the first. It goes on while you work in another area.',
    'Click for cursor A, again for B. Save keeps a picture as a file, Open shows it again.',
  ],
  keys: [
    ['Esc', 'Stop, everywhere and always'],
    ['1 … 6', 'choose the area'],
    ['F1', 'open and close this help'],
    ['← →', 'walk through the areas when one has the focus'],
    ['Space', 'hold to run, on a key that has the focus'],
  ] as const,
};
