"""Names of UBX messages by class and id, and the configuration keys of messages that can be enabled."""

from __future__ import annotations

#: Class, its name, and its messages as ``id:name``.
_CLASSES = {
    0x01: (
        "NAV",
        (
            "01:POSECEF 02:POSLLH 03:STATUS 04:DOP 05:ATT 06:SOL 07:PVT 09:ODO 10:RESETODO 11:VELECEF 12:VELNED "
            "13:HPPOSECEF 14:HPPOSLLH 17:PVAT 20:TIMEGPS 21:TIMEUTC 22:CLOCK 23:TIMEGLO 24:TIMEBDS 25:TIMEGAL "
            "26:TIMELS 27:TIMEQZSS 28:NMI 30:SVINFO 31:DGPS 32:SBAS 34:ORB 35:SAT 36:COV 39:GEOFENCE 3B:SVIN "
            "3C:RELPOSNED 3D:EELL 40:EKFSTATUS 42:SLAS 43:SIG 45:DAHEADING 60:AOPSTATUS 61:EOE 62:PL 63:TIMENAVIC "
            "64:TIMETRUSTED"
        ),
    ),
    0x02: (
        "RXM",
        (
            "10:RAW 11:SFRB 13:SFRBX 14:MEASX 15:RAWX 20:SVSI 30:ALM 31:EPH 32:RTCM 33:SPARTN 34:COR 36:SPARTN-KEY "
            "40:POSREQ 41:PMREQ 59:RLM 61:IMES 72:PMP 73:QZSSL6 74:TM 80:MEASD12 82:MEASC12 84:MEAS20 "
            "86:MEAS50"
        ),
    ),
    0x04: ("INF", ("00:ERROR 01:WARNING 02:NOTICE 03:TEST 04:DEBUG")),
    0x05: ("ACK", ("00:NAK 01:ACK")),
    0x06: (
        "CFG",
        (
            "00:PRT 01:MSG 02:INF 04:RST 06:DAT 07:TP 08:RATE 09:CFG 0E:FXN 11:RXM 12:EKF 13:ANT 16:SBAS 17:NMEA "
            "1B:USB 1D:TMODE 1E:ODO 22:NVS 23:NAVX5 24:NAV5 29:ESFGWT 31:TP5 32:PM 34:RINV 39:ITFM 3B:PM2 "
            "3D:TMODE2 3E:GNSS 41:OTP 47:LOGFILTER 4C:ESFA 4D:ESFG 53:TXSLOT 56:ESFALG 57:PWR 5C:HNR 60:ESRC "
            "61:DOSC 62:SMGR 64:SPT 69:GEOFENCE 70:DGNSS 71:TMODE3 82:ESFWT 84:FIXSEED 85:DYNSEED 86:PMS 88:SENIF "
            "8A:VALSET 8B:VALGET 8C:VALDEL 8D:SLAS 93:BATCH"
        ),
    ),
    0x09: ("UPD", ("14:SOS")),
    0x0A: (
        "MON",
        (
            "02:IO 04:VER 06:MSGPP 07:RXBUF 08:TXBUF 09:HW 0B:HW2 21:RXR 27:PATCH 28:GNSS 2B:PT2 2E:SMGR 2F:SPT "
            "31:SPAN 35:PMP 36:COMMS 37:HW3 38:RF 39:SYS"
        ),
    ),
    0x0B: ("AID", ("00:REQ 01:INI 02:HUI 10:DATA 30:ALM 31:EPH 32:ALPSRV 33:AOP 50:ALP")),
    0x0D: ("TIM", ("01:TP 03:TM2 04:SVIN 06:VRFY 11:DOSC 12:TOS 13:SMEAS 15:VCOCAL 16:FCHG 17:HOC")),
    0x10: ("ESF", ("02:MEAS 03:RAW 04:CAL 10:STATUS 13:RESETALG 14:ALG 15:INS")),
    0x13: ("MGA", ("10:SF 60:ACK 80:DBD")),
    0x21: (
        "LOG",
        (
            "03:ERASE 04:STRING 07:CREATE 08:INFO 09:RETRIEVE 0B:RETRIEVEPOS 0D:RETRIEVESTRING 0E:FINDTIME "
            "0F:RETRIEVEPOSEXTRA 10:RETRIEVEBATCH 11:BATCH"
        ),
    ),
    0x27: ("SEC", ("01:SIGN 03:UNIQID 09:SIG 0A:OSNMA 10:SIGLOG")),
    0x28: ("HNR", ("00:PVT 01:ATT 02:INS")),
    0x29: (
        "NAV2",
        (
            "01:POSECEF 02:POSLLH 03:STATUS 04:DOP 07:PVT 09:ODO 11:VELECEF 12:VELNED 17:PVAT 20:TIMEGPS "
            "21:TIMEUTC 22:CLOCK 23:TIMEGLO 24:TIMEBDS 25:TIMEGAL 26:TIMELS 27:TIMEQZSS 32:SBAS 35:SAT 36:COV "
            "3B:SVIN 3D:EELL 42:SLAS 43:SIG 61:EOE 63:TIMENAVIC"
        ),
    ),
}
CLASS_NAMES = {class_id: name for class_id, (name, _) in _CLASSES.items()}
NAMES = {
    (class_id, int(message_id, 16)): f"{class_name}-{name}"
    for class_id, (class_name, text) in _CLASSES.items()
    for message_id, _, name in (part.partition(":") for part in text.split())
}

#: Requestable messages: class, id, and the rate key of the first port (I2C); the keys of the other ports follow.
OUTPUTS = {
    "NAV-POSLLH": (0x01, 0x02, 0x20910029),
    "NAV-STATUS": (0x01, 0x03, 0x2091001A),
    "NAV-DOP": (0x01, 0x04, 0x20910038),
    "NAV-ATT": (0x01, 0x05, 0x2091001F),
    "NAV-SOL": (0x01, 0x06, 0x20910001),
    "NAV-PVT": (0x01, 0x07, 0x20910006),
    "NAV-VELNED": (0x01, 0x12, 0x20910042),
    "NAV-HPPOSLLH": (0x01, 0x14, 0x20910033),
    "NAV-TIMEGPS": (0x01, 0x20, 0x20910047),
    "NAV-TIMEUTC": (0x01, 0x21, 0x2091005B),
    "NAV-CLOCK": (0x01, 0x22, 0x20910065),
    "NAV-SVINFO": (0x01, 0x30, 0x2091000B),
    "NAV-SAT": (0x01, 0x35, 0x20910015),
    "RXM-SFRBX": (0x02, 0x13, 0x20910231),
    "RXM-RAWX": (0x02, 0x15, 0x209102A4),
    "NMEA-GGA": (0xF0, 0x00, 0x209100BA),
    "NMEA-GLL": (0xF0, 0x01, 0x209100C9),
    "NMEA-GSA": (0xF0, 0x02, 0x209100BF),
    "NMEA-GSV": (0xF0, 0x03, 0x209100C4),
    "NMEA-RMC": (0xF0, 0x04, 0x209100AB),
    "NMEA-VTG": (0xF0, 0x05, 0x209100B0),
    "NMEA-GST": (0xF0, 0x07, 0x209100D3),
    "NMEA-ZDA": (0xF0, 0x08, 0x209100D8),
    "NMEA-GNS": (0xF0, 0x0D, 0x209100B5),
}
#: Ports in the order of their keys.
PORTS = ("i2c", "uart1", "uart2", "usb", "spi")
