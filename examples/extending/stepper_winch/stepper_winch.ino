/* Winch of stepper motors behind STEP/DIR drivers, for own_stepper.py.

   Lines of ASCII text, 115200 bit/s; numbers are decimal:

     H               the arm is straight now: count from here, switch the drivers on
     M 120 -40 35 0 115
                     go to these steps from home; the last number is their sum
     S               brake and stay there until the next M
     ?               answer "P 120 -40 35 0 115", positions in steps and their sum,
                     or "U" before the first H

   Positions are counted, not measured: a motor that loses steps goes unnoticed.
   Damaged lines are ignored. Motors brake when no valid M has come for WATCHDOG. */

const int MOTORS = 4;
// pins of a CNC shield V3 with its fourth driver on pins 12 and 13
const int STEP_PINS[MOTORS] = {2, 3, 4, 12};
const int DIRECTION_PINS[MOTORS] = {5, 6, 7, 13};
const int ENABLE_PIN = 8;  // low: drivers are on
// 1 where HIGH at the direction pin pays the cable out, else -1
const int DIRECTIONS[MOTORS] = {1, 1, 1, 1};

const long LOW_LIMIT = -300;   // steps from home: 12 mm wound in, 1600 steps a turn
const long HIGH_LIMIT = 300;   // and a pulley of 10 mm radius
const float SPEED = 1500.0;         // steps/s
const float ACCELERATION = 8000.0;  // steps/s^2
const float GAIN = 40.0;            // 1/s, of the speed over the last few steps
const unsigned long WATCHDOG = 500000;  // us
const unsigned int LONGEST_LINE = 120;

long targets[MOTORS];
long positions[MOTORS];
float speeds[MOTORS];     // steps/s
float fractions[MOTORS];  // of the next step
bool isHomed = false;
bool isMoving = false;  // false: all brake
unsigned long commandedAt = 0;
unsigned long changedAt[MOTORS];
int changing = 0;  // motor whose speed changes next
unsigned long steppedAt = 0;
char line[LONGEST_LINE + 1];
unsigned int length = 0;

void setup() {
  for (int i = 0; i < MOTORS; i++) {
    pinMode(STEP_PINS[i], OUTPUT);
    pinMode(DIRECTION_PINS[i], OUTPUT);
  }
  digitalWrite(ENABLE_PIN, HIGH);
  pinMode(ENABLE_PIN, OUTPUT);
  Serial.begin(115200);
}

void loop() {
  while (Serial.available() > 0) collect(Serial.read());
  unsigned long now = micros();
  if (now - commandedAt > WATCHDOG) isMoving = false;
  // one after the other, so that no loop takes long and steps are even
  changing = (changing + 1) % MOTORS;
  changeSpeed(changing, 1e-6 * (now - changedAt[changing]));
  changedAt[changing] = now;
  for (int i = 0; i < MOTORS; i++) move(i, 1e-6 * (now - steppedAt));
  steppedAt = now;
}

void collect(char received) {
  if (received == '\n') {
    line[length] = 0;
    // a line that is too long is ignored as a whole
    if (length < LONGEST_LINE) obey();
    length = 0;
  } else if (received != '\r' && length < LONGEST_LINE) {
    line[length++] = received;
  }
}

void obey() {
  if (strcmp(line, "?") == 0) answer();
  if (strcmp(line, "S") == 0) isMoving = false;
  if (strcmp(line, "H") == 0) home();
  if (line[0] == 'M' && isHomed) readTargets();
}

void home() {
  for (int i = 0; i < MOTORS; i++) positions[i] = targets[i] = speeds[i] = fractions[i] = 0;
  isMoving = false;
  isHomed = true;
  digitalWrite(ENABLE_PIN, LOW);
}

void readTargets() {
  long numbers[MOTORS + 1];
  long sum = 0;
  char *rest = line + 1;
  for (int i = 0; i <= MOTORS; i++) {
    char *end;
    numbers[i] = strtol(rest, &end, 10);
    if (*rest != ' ' || end == rest) return;
    if (i < MOTORS) sum += numbers[i];
    rest = end;
  }
  if (*rest != 0 || sum != numbers[MOTORS]) return;
  for (int i = 0; i < MOTORS; i++) targets[i] = constrain(numbers[i], LOW_LIMIT, HIGH_LIMIT);
  isMoving = true;
  commandedAt = micros();
}

void answer() {
  if (!isHomed) {
    Serial.println("U");
    return;
  }
  long sum = 0;
  Serial.print("P");
  for (int i = 0; i < MOTORS; i++) {
    Serial.print(" ");
    Serial.print(positions[i]);
    sum += positions[i];
  }
  Serial.print(" ");
  Serial.println(sum);
}

// The speed from which a motor can brake before its target.
float wantedSpeed(long distance) {
  float length = labs(distance);
  float last = ACCELERATION / (GAIN * GAIN);  // steps that the gain brakes over
  float speed = GAIN * length;
  if (length > last) speed = sqrt(2.0 * ACCELERATION * (length - 0.5 * last));
  if (speed > SPEED) speed = SPEED;
  return distance < 0 ? -speed : speed;
}

void changeSpeed(int i, float duration) {
  float wanted = isMoving ? wantedSpeed(targets[i] - positions[i]) : 0.0;
  float most = ACCELERATION * duration;
  speeds[i] += constrain(wanted - speeds[i], -most, most);
}

void move(int i, float duration) {
  fractions[i] += speeds[i] * duration;
  if (fractions[i] >= 1.0) step(i, 1);
  if (fractions[i] <= -1.0) step(i, -1);
}

void step(int i, int way) {
  fractions[i] -= way;
  long next = positions[i] + way;
  if (next < LOW_LIMIT || next > HIGH_LIMIT) {
    speeds[i] = 0;
    return;
  }
  positions[i] = next;
  digitalWrite(DIRECTION_PINS[i], way == DIRECTIONS[i] ? HIGH : LOW);
  delayMicroseconds(2);
  digitalWrite(STEP_PINS[i], HIGH);
  delayMicroseconds(2);
  digitalWrite(STEP_PINS[i], LOW);
}
