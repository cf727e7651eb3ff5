"""Words of headings in many languages, and the quantity that they name together.

A heading is translated word by word to English; what is left must be one quantity and words that change nothing of it
(``static``, ``mean``). The unit is looked at by the caller: ``Tension (N)`` is a force in English and no voltage.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

_ABROAD = {  # English: as others write it, without accents, in lower case; a blank in a phrase is a ~
    "thrust": "schub schubkraft zugkraft poussee traction empuje traccion tiro spinta trazione empuxo tracao ciag tah "
    "stuwkracht trekkracht dragkraft тяга 推力 拉力 升力 추력 pull",
    "static thrust": "standschub standschubkraft statikschub",
    "torque": "drehmoment moment couple par~motor par~de~torsion par momento~torsor momento coppia~motrice coppia "
    "koppel moment~obrotowy binario kroutici~moment момент крутящий~момент 扭矩 转矩 轉矩 扭力 力矩 トルク 토크",
    "voltage": "spannung tension tension~electrique voltaje tensione tensao spanning napiecie napeti spanning "
    "напряжение 电压 電壓 電圧 전압 volt volts",
    "current": "strom stromstarke courant intensite corriente intensidad corrente stroom prad proud ток сила~тока "
    "电流 電流 전류 amp amps ampere amperes amperage",
    "power": "leistung puissance potencia potenza vermogen moc vykon effekt мощность 功率 電力 전력 watt watts",
    "time": "zeit temps tiempo tempo tijd czas cas время 时间 時間 시간",
    "throttle": "gas gasstellung gashebel knuppel gaz manette acelerador manetta commande drossel газ 油门 油門 "
    "スロットル 스로틀 thr throttle~setting throttle~position throttle~range throttle~command",
    "rotation speed": "drehzahl umdrehungen umdrehungszahl regime regimen vitesse~de~rotation velocidad~de~giro "
    "velocidad~de~rotacion velocidad~angular revoluciones giri numero~di~giri regime~di~rotazione "
    "velocita~di~rotazione rotacao toerental obroty otacky varvtal обороты частота~вращения 转速 轉速 回転数 회전수 "
    "vitesse~angulaire velocita~angolare angular~velocity",
    "airspeed": "fluggeschwindigkeit anstromgeschwindigkeit windgeschwindigkeit vitesse~air vitesse~du~vent "
    "vitesse~de~air velocidad~del~aire velocidad~del~viento velocita~aria velocita~dell~aria velocita~del~vento "
    "风速 風速 来流速度 空速 vinf uinf v~inf u~inf v∞ u∞ tas",
    "speed": "geschwindigkeit vitesse velocidad velocita velocidade snelheid velocity скорость 速度",
    "temperature": "temp temperatur temperatura temperatuur температура 温度 溫度 온도",
    "pressure": "druck pression presion pressione pressao druk давление 压力 气压 氣壓 大气压 大气压力 気圧 barometer "
    "baro",
    "air pressure": "luftdruck luchtdruck luchtdruk",
    "density": "dichte densite densidad densita densidade masse~volumique плотность 密度 rho ρ",
    "air density": "luftdichte",
    "humidity": "luftfeuchte luftfeuchtigkeit feuchte humidite humedad umidita umidade влажность 湿度 濕度 rh",
    "ambient temperature": "umgebungstemperatur lufttemperatur raumtemperatur aussentemperatur oat tamb tair",
    "ambient pressure": "umgebungsdruck pamb patm",
    "pulse width": "impulsbreite pulsbreite pulsweite largeur~impulsion ancho~de~pulso larghezza~impulso 脉宽",
    "electrical": "elektrische elektrisch electrique electrica electrico elettrica eletrica electric elec 电 电气 "
    "электрическая",
    "input": "eingangs entree entrada ingresso 输入 輸入 in consumption consumed",
    "output": "ausgangs abgabe sortie salida uscita 输出 輸出 out",
    "input power": "eingangsleistung aufnahmeleistung pin p~in pel p~el",
    "output power": "ausgangsleistung abgabeleistung pout p~out",
    "mechanical": "mechanische mechanisch mecanique mecanica mecanico meccanica 机械 mech brake",
    "shaft": "welle wellen arbre eje albero 轴",
    "shaft power": "wellenleistung pmech p~mech pshaft p~shaft",
    "propeller": "luftschraube helice elica propulseur 螺旋桨 桨 prop props",
    "motor": "moteur 电机 电机 馬達 двигатель engine",
    "battery": "akku batterie bateria batteria 电池 batt bat vbat pack",
    "battery voltage": "akkuspannung batteriespannung vbatt vbat vin v~in v~bat v~batt u~bat",
    "battery current": "ibat i~bat i~in i~batt akkustrom batteriestrom",
    "motor rotation speed": "motordrehzahl",
    "propeller rotation speed": "propellerdrehzahl luftschraubendrehzahl rotordrehzahl",
    "radius": "半径 半徑 rayon raggio radio halbmesser promien радиус radialposition position~radiale posicion~radial "
    "posizione~radiale",
    "chord": "弦长 弦長 sehne sehnenlange tiefe profiltiefe blatttiefe blattbreite corde corda cuerda cieciwa хорда "
    "longueur~de~corde",
    "thickness": "dicke profildicke blattdicke epaisseur espesor spessore espessura grubosc dikte толщина 厚度",
    "blade angle": "einstellwinkel blattwinkel steigungswinkel calage angle~de~calage angle~de~pas angle~de~pale "
    "calettamento angolo~di~calettamento angolo~di~pala angulo~de~paso angulo~de~pala angulo~de~calado 桨叶角 安装角 "
    "kat~nastawienia угол~установки",
    "scale": "waage kuchenwaage balanza bilancia",
    "weight": "gewicht poids peso вес 重量",
    "angle": "winkel angolo angulo kat угол hoek 角度",
    "pitch": "steigung pas passo paso",
    "static": "statisch statique estatico estatica statico statica 静态",
    "mean": "mittlerer mittlere mittelwert moyen moyenne medio media 平均 average avg",
    "ambient": "umgebung ambiant ambiante ambiente ambientale 环境 環境 室 room lab laboratory outside outdoor amb "
    "atmospheric atmosphere atm atmospherique atmosferica atmosferico barometric environment environmental inf",
    "air": "luft aire aria 空气 空氣 大气",
    "thrust coefficient": "schubbeiwert schubkoeffizient coefficient~de~poussee coefficient~de~traction "
    "coeficiente~de~empuje coeficiente~de~traccion coefficiente~di~spinta 推力系数 拉力系数",
    "power coefficient": "leistungsbeiwert leistungskoeffizient coefficient~de~puissance coeficiente~de~potencia "
    "coefficiente~di~potenza 功率系数",
    "torque coefficient": "drehmomentbeiwert momentenbeiwert coefficient~de~couple coeficiente~de~par 扭矩系数",
    "advance ratio": "parametre~avancement rapport~avancement parametro~de~avance "
    "rapporto~di~avanzamento 前进比 进速系数",
    "of": "de des du del della dell la le di da en do der die das the",
}  # fmt: skip
_PLAIN: dict[str, str] = {}
for _english, _others in _ABROAD.items():
    _PLAIN.update(dict.fromkeys((word.replace("~", " ") for word in _others.split()), _english))
_ASIAN = sorted((w for w in _PLAIN if not re.search(r"[a-zA-Zа-яρ∞]", w)), key=len, reverse=True)
FOREIGN = frozenset(w for w in _PLAIN if len(w) > 1 and re.search(r"[а-я\u3000-\u9fff]", w) and w not in {"om", "ток"})
"""Words that tell a code of characters."""
_LONGEST = max(len(word.split()) for word in _PLAIN)

NEUTRAL = {"mean", "measured", "corrected", "filtered", "net", "static", "of", "value", "actual", "raw", "reading"}
# quantity: dimension, its own words, words that change nothing, words of which one must be there
_HEADS: dict[str, tuple[str, set[str], set[str], set[str]]] = {
    "thrust": ("force", {"thrust"}, {"force", "propeller", "rotor", "motor", "output", "f", "fz", "t"}, set()),
    "torque": ("torque", {"torque"}, {"propeller", "rotor", "motor", "shaft", "reaction", "output", "m", "mz", "q"},
               set()),
    "voltage": ("voltage", {"voltage", "v", "u"}, {"battery", "supply", "input", "bus", "dc", "esc"}, set()),
    "current": ("current", {"current"},
                {"battery", "supply", "input", "bus", "dc", "esc", "draw", "total", "electrical"}, set()),
    "electrical power": ("power", {"power"}, {"electrical", "input", "battery", "supply", "esc", "dc", "total"},
                         {"electrical", "input"}),
    "mechanical power": ("power", {"power"}, {"mechanical", "shaft", "output", "propeller", "rotor"},
                         {"mechanical", "shaft", "output"}),
    "power": ("power", {"power"}, set(), set()),
    "time": ("time", {"time", "timestamp"}, {"elapsed", "test", "since", "start", "boot", "t"}, set()),
    "throttle": ("fraction", {"throttle", "command", "setting", "duty", "pwm"},
                 {"motor", "power", "cycle", "esc", "input", "position", "signal"}, set()),
    "pulse width": ("time", {"pulse", "pwm", "esc", "signal", "throttle"},
                    {"width", "servo", "input", "command", "motor"}, set()),
    "rpm": ("angular_speed", {"rotation", "rpm", "speed", "n"},
            {"propeller", "rotor", "shaft", "tachometer", "tach", "hall", "rotational"}, set()),
    "optical rpm": ("angular_speed", {"rotation", "speed"}, {"motor", "optical"}, {"optical"}),
    "electrical rpm": ("angular_speed", {"rotation", "speed"}, {"motor", "electrical"}, {"electrical"}),
    "airspeed": ("speed", {"airspeed", "speed", "wind", "freestream", "v", "u", "v0", "u0", "va"},
                 {"air", "flow", "free", "stream", "tunnel", "inflow", "flight", "true", "speed", "wind", "ambient"},
                 set()),
    "temperature": ("temperature", {"temperature", "t"}, {"ambient", "air", "tunnel", "inlet"},
                    {"temperature", "ambient"}),
    "pressure": ("pressure", {"pressure", "p"}, {"ambient", "air", "tunnel"}, {"pressure", "ambient"}),
    "density": ("density", {"density"}, {"ambient", "air"}, set()),
    "humidity": ("fraction", {"humidity"}, {"relative", "air", "ambient"}, set()),
    **{f"acceleration {axis}": ("acceleration", {"acc", "acceleration"}, {axis}, {axis}) for axis in "xyz"},
    "vibration": ("acceleration", {"vibration"}, set(), set()),
}  # fmt: skip
DIMENSIONS = {name: dimension for name, (dimension, *_) in _HEADS.items()}


def plain(text: str) -> str:
    """Lower case without accents; blanks for underscores."""
    bare = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return " ".join(bare.lower().replace("_", " ").split())


def english(text: str) -> list[str]:
    """Words of a heading without its unit, in English where they are known.

    >>> english("Velocidad del viento"), english("环境温度"), english("Schub / Thrust")
    (['airspeed'], ['ambient', 'temperature'], ['thrust', 'thrust'])
    """
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)  # batteryVoltage
    text = re.sub(r"\b(a )?[dl]['\u2019]", "", unicodedata.normalize("NFC", plain(text)))
    for word in _ASIAN:
        if word in text:
            text = text.replace(word, f" {_PLAIN[word]} ")
    words = re.findall(r"[^\W_]+[∞]?", text)
    out: list[str] = []
    at = 0
    while at < len(words):
        for n in range(min(_LONGEST, len(words) - at), 0, -1):
            found = _PLAIN.get(" ".join(words[at : at + n]))
            if found or n == 1:
                out += (found or words[at]).split()
                at += n
                break
    return out


def in_any_language(word: str) -> re.Pattern[str]:
    """Pattern of an English word and of what others write for it, in `plain` text."""
    return re.compile(rf"(?<![^\W_])(?:{'|'.join((word, *_ABROAD[word].split()))})(?![^\W_])")


def of_others(quantity: str) -> set[str]:
    """Words that other quantities have and this one has not."""
    _, heads, harmless, _ = _HEADS[quantity]
    return {w for _, own, more, _ in _HEADS.values() for w in own | more} - heads - harmless - NEUTRAL


def quantities(words: Iterable[str]) -> list[tuple[str, str]]:
    """Quantities that words may name and their dimensions: all words must belong to one.

    >>> quantities(["static", "thrust"]), quantities(["motor", "thrust", "error"])
    ([('thrust', 'force')], [])
    """
    said = set(words) - NEUTRAL
    out = []
    for name, (dimension, heads, harmless, needs) in _HEADS.items():
        if said & heads and said <= heads | harmless and (not needs or said & needs):
            out.append((name, dimension))
    return out
