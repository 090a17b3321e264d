// The same trigger on an absolute schedule: wait for micros(), then digitalWrite.
// 70 volumes, one every 225 ms; laser on D9, camera trigger on D10, stimulation LED on D6.

const int LASER = 9;
const int CAMERA = 10;
const int LED = 6;
const int VOLUMES = 70;
const int VOLUMES_BEFORE_LED = 5;
const unsigned long SWEEP_US = 8533;         // 512 images at 60,000 per second
const unsigned long CAMERA_PULSE_US = 100;
const unsigned long INTERVAL_US = 225000;

volatile byte lastByte;

void readSerial() {
  while (Serial.available() > 0) {
    lastByte = Serial.read();
  }
}

// The difference is right across the wrap of micros(), every 71.6 minutes.
void waitUntil(unsigned long when) {
  while ((long)(micros() - when) < 0) {
    readSerial();
  }
}

void sweep(unsigned long start) {
  waitUntil(start);
  digitalWrite(LASER, HIGH);
  digitalWrite(CAMERA, HIGH);
  waitUntil(start + CAMERA_PULSE_US);
  digitalWrite(CAMERA, LOW);
  waitUntil(start + SWEEP_US);
  digitalWrite(LASER, LOW);
}

unsigned long first;

void setup() {
  pinMode(LASER, OUTPUT);
  pinMode(CAMERA, OUTPUT);
  pinMode(LED, OUTPUT);
  Serial.begin(250000);
  first = micros() + 100000UL;
}

int volume = 0;

void loop() {
  if (volume == VOLUMES) {
    readSerial();
    digitalWrite(LED, LOW);
    return;
  }
  unsigned long start = first + volume * INTERVAL_US;
  if (volume == VOLUMES_BEFORE_LED) {
    waitUntil(start - 1000);
    digitalWrite(LED, HIGH);
  }
  sweep(start);
  volume += 1;
}
