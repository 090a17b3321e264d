// A sweep trigger as laboratories write it: digitalWrite and delay.
// 70 volumes, one every 225 ms; laser on D9, camera trigger on D10, stimulation LED on D6.

const int LASER = 9;
const int CAMERA = 10;
const int LED = 6;
const int VOLUMES = 70;
const int VOLUMES_BEFORE_LED = 5;
const unsigned int SWEEP_US = 8533;          // 512 images at 60,000 per second
const unsigned int CAMERA_PULSE_US = 100;
const unsigned int REST_MS = 216;            // 225 ms less the sweep: 216 ms and 467 us
const unsigned int REST_US = 467;

volatile byte lastByte;

void readSerial() {
  while (Serial.available() > 0) {
    lastByte = Serial.read();
  }
}

void sweep() {
  digitalWrite(LASER, HIGH);
  digitalWrite(CAMERA, HIGH);
  delayMicroseconds(CAMERA_PULSE_US);
  digitalWrite(CAMERA, LOW);
  delayMicroseconds(SWEEP_US - CAMERA_PULSE_US);
  digitalWrite(LASER, LOW);
}

void setup() {
  pinMode(LASER, OUTPUT);
  pinMode(CAMERA, OUTPUT);
  pinMode(LED, OUTPUT);
  Serial.begin(250000);
  delay(100);
}

int volume = 0;

void loop() {
  readSerial();
  if (volume == VOLUMES) {
    digitalWrite(LED, LOW);
    return;
  }
  if (volume == VOLUMES_BEFORE_LED) {
    digitalWrite(LED, HIGH);
  }
  sweep();
  volume += 1;
  delay(REST_MS);
  delayMicroseconds(REST_US);
}
