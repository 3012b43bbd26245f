//! Two flocking laws from the literature as pilots: `olfati-saber` and `vasarhelyi`. The program has every command of `skein`.

mod olfati_saber;
mod surroundings;
mod vasarhelyi;

use olfati_saber::OlfatiSaber;
use vasarhelyi::Vasarhelyi;

fn main() -> std::process::ExitCode {
    skein::App::new()
        .try_pilot("olfati-saber", |birth| Ok(Box::new(OlfatiSaber::new(birth.params.parse()?))))
        .try_pilot("vasarhelyi", |birth| Ok(Box::new(Vasarhelyi::new(birth.params.parse()?))))
        .main()
}
