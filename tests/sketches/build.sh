#!/bin/sh
# Build the Arduino sketches beside this script: build.sh OUTDIR writes NAME.elf and NAME.hex.
#
# Takes Arduino's core for AVR as Debian packages it (arduino-core-avr, gcc-avr, avr-libc), and
# compiles as the Arduino IDE does for an Uno. ARDUINO_AVR names another place of the core.
set -eu

[ $# -eq 1 ] || { echo "usage: build.sh OUTDIR" >&2; exit 2; }
sketches=$(cd "$(dirname "$0")" && pwd)
avr=${ARDUINO_AVR:-/usr/share/arduino/hardware/arduino/avr}
core=$avr/cores/arduino
[ -f "$core/Arduino.h" ] || { echo "no Arduino core in $avr (arduino-core-avr)" >&2; exit 1; }
mkdir -p "$1"
out=$(cd "$1" && pwd)
objects=$(mktemp -d)
trap 'rm -rf "$objects"' EXIT

# platform.txt's flags, without link-time optimisation of the assembler files.
board="-mmcu=atmega328p -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_AVR_UNO -DARDUINO_ARCH_AVR"
common="-g -Os -w -ffunction-sections -fdata-sections -flto $board -I$core -I$avr/variants/standard"
c="-std=gnu11 -fno-fat-lto-objects $common"
# The float.h of GCC 5 gives DECIMAL_DIG to C alone.
cpp="-DDECIMAL_DIG=__DECIMAL_DIG__ -std=gnu++11 -fpermissive -fno-exceptions -fno-threadsafe-statics $common"

for source in "$core"/*.c; do
    avr-gcc -c $c "$source" -o "$objects/$(basename "$source").o"
done
for source in "$core"/*.cpp; do
    avr-g++ -c $cpp "$source" -o "$objects/$(basename "$source").o"
done
for source in "$core"/*.S; do
    avr-gcc -c -x assembler-with-cpp $board "$source" -o "$objects/$(basename "$source").o"
done
avr-gcc-ar rcs "$objects/core.a" "$objects"/*.o

for sketch in "$sketches"/*.ino; do
    name=$(basename "$sketch" .ino)
    avr-g++ -c $cpp -x c++ -include Arduino.h "$sketch" -o "$objects/$name.ino.o"
    avr-gcc -Os -g -w -flto -fuse-linker-plugin -Wl,--gc-sections -mmcu=atmega328p \
        "$objects/$name.ino.o" "$objects/core.a" -lm -o "$out/$name.elf"
    avr-objcopy -O ihex -R .eeprom "$out/$name.elf" "$out/$name.hex"
    avr-size "$out/$name.elf"
done
