//! Purposes of rooms from their names, and the rooms in which things belong.

use super::Class;
use std::sync::LazyLock;
use unicode_normalization::UnicodeNormalization;
use unicode_normalization::char::is_combining_mark;

/// Set of purposes of a room: several for a studio, none if the name does not tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Purposes(u16);

impl Purposes {
    pub const NONE: Purposes = Purposes(0);
    pub const BATH: Purposes = Purposes(1);
    pub const SLEEP: Purposes = Purposes(1 << 1);
    pub const COOK: Purposes = Purposes(1 << 2);
    pub const LIVE: Purposes = Purposes(1 << 3);
    pub const DINE: Purposes = Purposes(1 << 4);
    pub const WORK: Purposes = Purposes(1 << 5);
    /// Laundry, closets, pantries.
    pub const STORE: Purposes = Purposes(1 << 6);
    pub const PASS: Purposes = Purposes(1 << 7);
    /// Balconies and terraces.
    pub const OUTSIDE: Purposes = Purposes(1 << 8);

    pub const fn or(self, other: Purposes) -> Purposes {
        Purposes(self.0 | other.0)
    }

    pub fn is_none(self) -> bool {
        self == Purposes::NONE
    }

    /// Returns whether all of `other` are among these.
    pub fn has(self, other: Purposes) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns the purposes of a room by its name, in any of the languages of `WORDS`.
    pub fn of_name(name: &str) -> Purposes {
        /// Longer names are cut, because the files are untrusted.
        const MAX_CHARS: usize = 100;
        let name = fold(&name.chars().take(MAX_CHARS).collect::<String>());
        let words: Vec<&str> =
            name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
        let told = PATTERNS.iter().filter(|(pattern, _)| words.iter().any(|word| pattern.fits(word)));
        told.fold(Purposes::NONE, |sum, (_, purposes)| sum.or(*purposes))
    }

    /// Returns whether things of this class belong only in some rooms.
    pub fn any_for(class: Class) -> bool {
        !class.purposes().is_none()
    }

    /// Returns whether a thing belongs in this room; `None` if the room or the class has no purpose.
    pub fn suit(self, class: Class) -> Option<bool> {
        let homes = class.purposes();
        (!self.is_none() && !homes.is_none()).then_some(self.0 & homes.0 != 0)
    }
}

impl Class {
    /// Returns the purposes of the rooms in which such things stand; none for things that stand anywhere.
    fn purposes(self) -> Purposes {
        use Purposes as P;
        match self {
            Class::Toilet | Class::Bathtub | Class::Shower => P::BATH,
            Class::Bed => P::SLEEP,
            Class::Stove => P::COOK,
            Class::Refrigerator => P::COOK.or(P::STORE).or(P::DINE),
            Class::Counter => P::COOK.or(P::BATH).or(P::STORE).or(P::DINE),
            Class::Sink => P::COOK.or(P::BATH).or(P::STORE),
            Class::WashingMachine => P::COOK.or(P::BATH).or(P::STORE).or(P::PASS),
            Class::Sofa => P::LIVE.or(P::SLEEP).or(P::WORK).or(P::DINE),
            Class::Table | Class::Chair | Class::Desk | Class::Pillow => P::LIVE
                .or(P::SLEEP)
                .or(P::WORK)
                .or(P::DINE)
                .or(P::COOK)
                .or(P::OUTSIDE)
                .or(P::STORE)
                .or(P::PASS),
            Class::Television => P::LIVE.or(P::SLEEP).or(P::WORK).or(P::DINE).or(P::COOK),
            _ => P::NONE,
        }
    }
}

/// Returns the name in lower case, without accents.
fn fold(name: &str) -> String {
    name.nfkd().filter(|c| !is_combining_mark(*c)).flat_map(char::to_lowercase).collect()
}

/// A word, or a part of a word with `*` for the rest.
struct Pattern {
    text: String,
    open_before: bool,
    open_after: bool,
}

impl Pattern {
    fn new(pattern: &str) -> Pattern {
        Pattern {
            text: fold(pattern.trim_matches('*')),
            open_before: pattern.starts_with('*'),
            open_after: pattern.ends_with('*'),
        }
    }

    fn fits(&self, word: &str) -> bool {
        match (self.open_before, self.open_after) {
            (false, false) => word == self.text,
            (true, false) => word.ends_with(&self.text),
            (false, true) => word.starts_with(&self.text),
            (true, true) => word.contains(&self.text),
        }
    }
}

static PATTERNS: LazyLock<Vec<(Pattern, Purposes)>> = LazyLock::new(|| {
    let of = |(words, purposes): &(&str, Purposes)| {
        let purposes = *purposes;
        words.split_whitespace().map(move |word| (Pattern::new(word), purposes)).collect::<Vec<_>>()
    };
    WORDS.iter().flat_map(of).collect()
});

/// Names in English, German, French, Spanish, Italian, Portuguese, Dutch, Swedish, Danish, Norwegian,
/// Finnish, Polish, Turkish, Russian, Chinese, Japanese and Korean, in that order.
const WORDS: &[(&str, Purposes)] = &[
    (
        "bath* *bathroom washroom restroom shower* toilet* wc ensuite powder lavatory \
         bad badezimmer *bad duschbad *toilette bain* toilettes bano aseo ducha bagno banheiro banho badkamer badrum dusch* \
         badeværelse baderom toalett *kylpyhuone vessa lazienka łazienka toaleta banyo tuvalet ванная туалет санузел \
         *卫生间* *浴室* *洗手间* *厕所* *トイレ* *洗面* *風呂* *욕실* *화장실*",
        Purposes::BATH,
    ),
    (
        "bed* *bedroom nursery kid* child* schlaf* kinder* gastezimmer gaestezimmer chambre* dormitorio* habitacion* camera \
         cameretta quarto* slaap* kinderkamer sovrum* sovevær* soverom* barnrum makuuhuone* sypialnia yatak* спальня детская \
         *卧室* *儿童房* *主卧* *次卧* *寝室* *子供部屋* *침실*",
        Purposes::SLEEP,
    ),
    (
        "kitchen* kuche *kuche kueche *kueche kochnische cuisine* cocina* cucina cozinha keuken* kok køkken* kjøkken* keittio* \
         kuchnia mutfak кухня* *厨房* *キッチン* *台所* *주방* *부엌*",
        Purposes::COOK,
    ),
    (
        "living* lounge den family wohn* stube salon salotto soggiorno sejour sala woonkamer vardagsrum stue olohuone oturma \
         гостиная зал *客厅* *リビング* *居間* *거실*",
        Purposes::LIVE,
    ),
    (
        "dining* diner ess* manger comedor pranzo jantar eetkamer matsal spisestue ruokailu* jadalnia yemek столовая *餐厅* \
         *ダイニング* *식당*",
        Purposes::DINE,
    ),
    (
        "office study desk *schreibtisch* buro buero arbeit* bureau despacho oficina ufficio escritorio kantoor werkkamer kontor* \
         arbetsrum tyohuone gabinet çalışma кабинет *书房* *办公* *書斎* *서재*",
        Purposes::WORK,
    ),
    (
        "utility laundry storage storeroom store closet wardrobe pantry garage hauswirtschafts* abstell* waschkuche speisekammer \
         keller* ankleide* buanderie dressing cellier lavadero trastero despensa ripostiglio lavanderia lavandaria berging \
         bijkeuken tvattstuga forrad bod vaskerum kodinhoito* garderoba spizarnia kiler кладовая гардероб* *储物* *衣帽* *納戸* \
         *クローゼット* *창고* *드레스룸*",
        Purposes::STORE,
    ),
    (
        "corridor hall* *hallway entrance entry foyer landing *flur diele gang eingang* couloir entree pasillo recibidor entrada \
         corridoio ingresso corredor hal overloop eteinen kaytava korytarz przedpokoj koridor antre hol коридор прихожая холл \
         *走廊* *玄关* *玄関* *廊下* *복도* *현관*",
        Purposes::PASS,
    ),
    (
        "balcony terrace patio balkon* terrasse* balcon* terraza balcone terrazzo varanda balkong parveke балкон *阳台* \
         *ベランダ* *バルコニー* *베란다* *발코니*",
        Purposes::OUTSIDE,
    ),
    // One room for several purposes.
    (
        "studio* wohnkuche *apartment*",
        Purposes::SLEEP.or(Purposes::COOK).or(Purposes::LIVE).or(Purposes::DINE).or(Purposes::WORK),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use Purposes as P;

    #[test]
    fn names_tell_what_rooms_are_for() {
        let studio = P::SLEEP.or(P::COOK).or(P::LIVE).or(P::DINE).or(P::WORK);
        for (name, want) in [
            ("Kitchen", P::COOK),
            ("kitchen 2", P::COOK),
            ("Küche", P::COOK),
            // The same with a combining diaeresis.
            ("Ku\u{308}che", P::COOK),
            ("KUECHE", P::COOK),
            ("Living/Kitchen", P::LIVE.or(P::COOK)),
            ("Wohn-/Esszimmer", P::LIVE.or(P::DINE)),
            ("Schlafzimmer", P::SLEEP),
            ("Bad", P::BATH),
            ("Gästebad", P::BATH),
            ("Badminton", P::NONE),
            ("Flur ", P::PASS),
            ("Essbereich", P::DINE),
            ("Schreibtisch", P::WORK),
            ("salle de bain", P::BATH),
            ("Łazienka", P::BATH),
            ("Badeværelse", P::BATH),
            ("спальня", P::SLEEP),
            ("主卧室", P::SLEEP),
            ("リビング", P::LIVE),
            ("거실", P::LIVE),
            ("Child's room", P::SLEEP),
            ("Studio", studio),
            ("room1", P::NONE),
            ("Anna", P::NONE),
            ("", P::NONE),
        ] {
            assert_eq!(P::of_name(name), want, "{name}");
        }
        assert_eq!(P::of_name(&"bad ".repeat(1000)), P::BATH);
    }

    #[test]
    fn things_belong_into_rooms() {
        for (purposes, class, want) in [
            (P::SLEEP, Class::Bed, Some(true)),
            (P::COOK, Class::Bed, Some(false)),
            (P::COOK.or(P::SLEEP), Class::Bed, Some(true)),
            (P::NONE, Class::Bed, None),
            (P::COOK, Class::Chair, Some(true)),
            (P::BATH, Class::Cabinet, None),
            (P::COOK, Class::Wall, None),
            (P::BATH, Class::Toilet, Some(true)),
            (P::PASS, Class::Toilet, Some(false)),
        ] {
            assert_eq!(purposes.suit(class), want, "{purposes:?} {class:?}");
        }
    }
}
