; Exercises of the board with cycles that follow from the data sheet; the marks and the expected
; cycles are in check.mjs. Each exercise is a whole image, selected by -DEXERCISE=n.

#define __SFR_OFFSET 0
#include <avr/io.h>

.global main
.section .text
vectors:
    jmp main
    .org 0x04            ; INT0
    sbi PORTB, 3
    reti
    .org 0x14            ; PCINT2
    sbi PORTB, 4
    reti
    .org 0x2c            ; TIMER1_COMPA
    sbi PORTB, 4         ; two cycles
    reti
    .org 0x68

main:
    ldi r16, 0xff        ; cycle 3, after the jump
    out DDRB, r16        ; 4
    out DDRD, r16        ; 5
    ldi r17, 1           ; 6

; One cycle each, so that an interrupt's entry is exact.
.macro NOPS
1:  .rept 250
    nop
    .endr
    rjmp 1b
.endm

#if EXERCISE == 1        /* compare outputs, capture, reads of the count */
    ldi r16, 0xf0        ; 7
    sts TCCR1A, r16      ; 8
    out TCCR0A, r16      ; 10: both timers set A and B on match
    ldi r18, 0           ; 11
    ldi r19, 200         ; 12
    sts OCR1AH, r18      ; 13
    sts OCR1AL, r19      ; 15
    sts OCR1BH, r17      ; 17
    sts OCR1BL, r19      ; 19: OCR1A = 200, OCR1B = 456
    out OCR0A, r19       ; 21
    out OCR0B, r17       ; 22: OCR0A = 200, OCR0B = 1
    ldi r18, (1 << ICES1) | 1 ; 23
    sts TCCR1B, r18      ; 24: timer 1 is 0 during cycle 26
    out TCCR0B, r17      ; 26: timer 0 is 0 during cycle 27
    in r20, TCNT0        ; 27
    lds r21, TCNT1L      ; 28, reads in 29
    lds r22, TCNT0 + 32  ; 30, reads in 31
    sbi PORTB, 5         ; 32: D13 high from 34 on
1:  in r16, TIFR1        ; 34
    sbrs r16, ICF1
    rjmp 1b
    lds r24, ICR1L
    lds r25, ICR1H
    cbi PORTB, 5
2:  rjmp 2b
#endif

#if EXERCISE == 2 || EXERCISE == 3  /* interrupt from a match; 3: out of sleep */
    ldi r19, 50          ; 7
    sts OCR1AH, r1       ; 8
    sts OCR1AL, r19      ; 10
    ldi r18, 1 << OCIE1A ; 12
    sts TIMSK1, r18      ; 13
    out SMCR, r17        ; 15: sleep is allowed, idle
    sts TCCR1B, r17      ; 16: timer 1 is 0 during cycle 18
    sei                  ; 18
#if EXERCISE == 3
    sleep                ; 19
#endif
    NOPS
#endif

#if EXERCISE == 4        /* the output latch outlives a disconnection; flags are cleared one by one */
    ldi r16, 0xc0        ; 7
    sts TCCR1A, r16      ; 8
    ldi r16, 0x80        ; 10
    sts TCCR1C, r16      ; 11: force: D9 high from 13 on
    sts TCCR1A, r1       ; 13: disconnected: D9 low from 15 on
    ldi r16, 0x80        ; 15
    sts TCCR1A, r16      ; 16: connected, to clear on match: D9 high from 18 on
    sts TCCR1B, r17      ; 18: timer 1 runs
    nop                  ; 20: OCR1A = OCR1B = 0 match at the first count: D9 low from 21 on
    in r24, TIFR1
    ldi r16, 1 << OCF1A
    out TIFR1, r16
    in r25, TIFR1
2:  rjmp 2b
#endif

#if EXERCISE == 5        /* watchdog: 16 ms, then a reset; MCUSR in r24 */
    in r24, MCUSR
    sbrc r24, WDRF
1:  rjmp 1b
    sbi PORTD, 6
    ldi r16, (1 << WDCE) | (1 << WDE)
    sts WDTCSR, r16
    ldi r16, 1 << WDE
    sts WDTCSR, r16
2:  rjmp 2b
#endif

#if EXERCISE == 6        /* three bytes received late, then echoed */
    cbi DDRD, 2
    ldi r16, 7
    sts UBRR0L, r16      ; 250,000 baud with U2X
    ldi r16, 1 << U2X0
    sts UCSR0A, r16
    ldi r16, (1 << RXEN0) | (1 << TXEN0)
    sts UCSR0B, r16
    sbi PORTD, 7
1:  sbis PIND, 2         ; wait for D2
    rjmp 1b
2:  lds r16, UCSR0A
    sbrs r16, UDRE0
    rjmp 2b
    sbrs r16, RXC0
    rjmp 2b
    lds r17, UDR0
    sts UDR0, r17
    rjmp 2b
#endif

#if EXERCISE == 7        /* D2 changes: pin-change and external interrupt */
    cbi DDRD, 2
    sts EICRA, r17       ; INT0 at any change
    ldi r16, 1 << PCINT18
    sts PCMSK2, r16
    ldi r16, 1 << PCIE2
    sts PCICR, r16
    out EIMSK, r17
    sei
    NOPS
#endif
