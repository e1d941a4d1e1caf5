// Runs stepper_winch.ino on a computer, in a time of its own.
//
// Input: lines "MICROSECONDS TEXT"; the sketch hears TEXT at that time. Output: what it
// prints, and before it, as "pulses on a b ...", whether its drivers are on, and the
// pulses that they have got.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <sstream>
#include <string>

enum { LOW, HIGH, OUTPUT };
#define constrain(value, low, high) \
  ((value) < (low) ? (low) : ((value) > (high) ? (high) : (value)))

const unsigned long LOOP_TIME = 500;  // us
unsigned long now_us = 0;
int levels[64];
long pulses[64];  // by step pin
void pulse(int pin);

void pinMode(int, int) {}
void delayMicroseconds(int) {}
unsigned long micros() { return now_us; }
void digitalWrite(int pin, int level) {
  if (level == HIGH && levels[pin] == LOW) pulse(pin);
  levels[pin] = level;
}

struct {
  std::string heard;
  void begin(long) {}
  int available() { return heard.size(); }
  int read() {
    char first = heard[0];
    heard.erase(0, 1);
    return first;
  }
  void print(const char *text) { std::cout << text; }
  void print(long number) { std::cout << number; }
  void println(const char *text) { std::cout << text << "\r\n"; }
  void println(long number) { std::cout << number << "\r\n"; }
} Serial;

// the Arduino IDE writes such lines by itself
void collect(char);
void obey();
void home();
void readTargets();
void answer();
float wantedSpeed(long);
void changeSpeed(int, float);
void move(int, float);
void step(int, int);
#include SKETCH

void pulse(int pin) {
  for (int i = 0; i < MOTORS; i++)
    if (pin == STEP_PINS[i])
      pulses[i] += levels[DIRECTION_PINS[i]] == HIGH ? DIRECTIONS[i] : -DIRECTIONS[i];
}

int main() {
  setup();
  std::string input;
  while (std::getline(std::cin, input)) {
    std::size_t gap = input.find(' ');
    unsigned long until = std::stoul(input.substr(0, gap));
    for (; now_us < until; now_us += LOOP_TIME) loop();
    std::string text = input.substr(gap + 1);
    if (text == "?") {
      std::cout << "pulses " << (levels[ENABLE_PIN] == LOW ? "on" : "off");
      for (int i = 0; i < MOTORS; i++) std::cout << " " << pulses[i];
      std::cout << "\n";
    }
    Serial.heard += text + "\n";
    loop();
    now_us += LOOP_TIME;
  }
}
